"""What the commands do with a folder: all or nothing."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from building_maps.halls import around, hall, map_of
from building_maps.rounds import furthest_m, round_map

from wayfi.backend.errors import WayfiError
from wayfi.backend.pose2 import Pose2
from wayfi.frontends.merging.merging import MergeError
from wayfi.recordings.files.map_folder import MapError
from wayfi.recordings.files.tum import write_tum
from wayfi.recordings.map.loading import load_map
from wayfi.recordings.map.saving import save_map
from wayfi.service.config import load_config
from wayfi.service.maps.aligning import align_map
from wayfi.service.maps.editing import closures
from wayfi.service.maps.merging import merge_maps
from wayfi.service.maps.saved_maps import optimising, save_edited

CONFIG = load_config((), ())
FALSE = (10, 40, Pose2(0.0, 6.0, math.pi))


@pytest.fixture
def saved(tmp_path: Path) -> Path:
    save_map(tmp_path / "map", round_map(false=FALSE))
    return tmp_path / "map"


def contents(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def test_a_veto_is_saved_as_the_next_version_and_can_be_undone(saved: Path) -> None:
    before = load_map(saved)
    vetoed = closures(saved, [7], [], CONFIG)
    after = load_map(saved)
    assert (after.map_id, after.map_version) == (before.map_id, 2)
    assert (vetoed.name.map_version, vetoed.closures[7].verdict) == (2, "vetoed")
    assert after.building.vetoed == {7}
    assert furthest_m(after.building.poses, round_map().poses) < 0.02
    restored = closures(saved, [], [7], CONFIG)
    assert restored.moved_m > 0.5
    assert load_map(saved).building.vetoed == frozenset()


def test_the_list_changes_nothing(saved: Path) -> None:
    before = contents(saved)
    assert [c.number for c in closures(saved, [], [], CONFIG).closures] == list(range(8))
    assert contents(saved) == before


@pytest.mark.parametrize(("veto", "restore"), [([99], []), ([7, 0], []), ([7], [3])])
def test_an_edit_that_is_refused_leaves_the_map(saved: Path, veto: list[int], restore: list[int]) -> None:
    before = contents(saved)
    with pytest.raises(WayfiError):
        closures(saved, veto, restore, CONFIG)
    assert contents(saved) == before


def test_a_disk_that_is_full_leaves_the_map(saved: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before = contents(saved)

    def full(path: Path, _: bytes) -> int:
        raise OSError(28, "No space left on device", str(path))

    with monkeypatch.context() as patched:
        patched.setattr(Path, "write_bytes", full)
        with pytest.raises(MapError, match="No space left on device"):
            closures(saved, [7], [], CONFIG)
    assert load_map(saved).map_version == 1
    assert {name: data for name, data in contents(saved).items() if name in before} == before
    assert closures(saved, [7], [], CONFIG).name.map_version == 2


def test_what_another_program_has_saved_meanwhile_is_not_lost(saved: Path) -> None:
    loaded = load_map(saved)
    closures(saved, [7], [], CONFIG)
    with pytest.raises(MapError, match="was saved by another program meanwhile"):
        save_edited(loaded, loaded.building, CONFIG)
    assert load_map(saved).building.vetoed == {7}


def test_a_vetoed_closure_is_no_edge_of_the_graph_for_others(saved: Path) -> None:
    edges = (saved / "graph.g2o").read_text().count("EDGE_SE2")
    closures(saved, [7], [], CONFIG)
    assert (saved / "graph.g2o").read_text().count("EDGE_SE2") == edges - 1


def test_an_aligned_map_says_so_and_keeps_it(saved: Path, tmp_path: Path) -> None:
    loaded = load_map(saved)
    stamps = np.array([k.stamp_ns for k in loaded.building.keyframes])[[0, 20, 40]]
    write_tum(tmp_path / "fixes.tum", stamps, loaded.building.poses[[0, 20, 40]] + [100.0, 5.0, 0.0])
    aligned = align_map(saved, tmp_path / "fixes.tum", None, CONFIG)
    assert aligned.alignment.used.all()
    closures(saved, [7], [], CONFIG)
    again = load_map(saved)
    assert again.map_version == 3
    assert again.name.aligned == pytest.approx((100.0, 5.0, 0.0), abs=1e-6)
    assert again.building.poses[0] == pytest.approx([100.0, 5.0, 0.0], abs=1e-3)
    assert json.loads((saved / "manifest.json").read_text())["aligned"] == pytest.approx([100.0, 5.0, 0.0], abs=1e-6)


def test_fixes_that_are_refused_are_named_with_their_file(saved: Path, tmp_path: Path) -> None:
    write_tum(tmp_path / "fixes.tum", np.array([0]), np.zeros((1, 3)))
    with pytest.raises(WayfiError, match=r"fixes\.tum: 1 of 1 fixes"):
        align_map(saved, tmp_path / "fixes.tum", None, CONFIG)


def test_aligned_into_another_folder_the_map_stays(saved: Path, tmp_path: Path) -> None:
    before = contents(saved)
    poses = load_map(saved).building.poses[[0, 20]]
    write_tum(tmp_path / "fixes.tum", np.array([0, 20_000_000_000]), poses)
    align_map(saved, tmp_path / "fixes.tum", tmp_path / "plan", CONFIG)
    assert contents(saved) == before
    assert load_map(tmp_path / "plan").map_version == 2


def test_two_saved_maps_become_a_third(tmp_path: Path) -> None:
    place = hall()
    save_map(tmp_path / "a", map_of(place, around(0.0, 96.0)))
    save_map(tmp_path / "b", map_of(place, around(60.0, 80.0, back=True, inset_m=5.0), seed=1))
    merged = merge_maps(tmp_path / "a", tmp_path / "b", tmp_path / "c", CONFIG)
    loaded = load_map(tmp_path / "c")
    assert loaded.name == merged.name
    assert loaded.map_id not in (load_map(tmp_path / "a").map_id, load_map(tmp_path / "b").map_id)
    assert loaded.manifest.counts["sessions"] == 2
    number = len(loaded.building.closures) - 1
    assert closures(tmp_path / "c", [number], [], CONFIG).closures[number].verdict == "vetoed"


def test_a_map_is_not_merged_with_itself_or_into_itself(saved: Path, tmp_path: Path) -> None:
    with pytest.raises(MergeError, match="is of the same map"):
        merge_maps(saved, saved, tmp_path / "c", CONFIG)
    other = tmp_path / "other"
    save_map(other, replace(round_map(), fingerprints=[]))
    with pytest.raises(MergeError, match="is one of the two maps"):
        merge_maps(saved, other, other, CONFIG)


def test_what_is_optimised_is_what_is_configured() -> None:
    config = load_config((), ["map.resolution_m=0.1", "odometry.prior_turn_scale=0.5"])
    assert optimising(config).grid.resolution_m == 0.1
    assert optimising(config).wheels.sigmas[1] == 0.5
