"""The commands about saved maps, as they are typed."""

import math
from pathlib import Path

import numpy as np
import pytest
from building_maps.halls import around, hall, map_of
from building_maps.rounds import round_map
from command_line import one_object, wayfi

from wayfi.backend.pose2 import Pose2
from wayfi.recordings.files.tum import write_tum
from wayfi.recordings.map.loading import load_map
from wayfi.recordings.map.saving import save_map


@pytest.fixture
def saved(tmp_path: Path) -> Path:
    save_map(tmp_path / "result" / "map", round_map(false=(10, 40, Pose2(0.0, 6.0, math.pi))))
    return tmp_path / "result"


def test_closures_are_listed_for_people_and_for_programs(saved: Path) -> None:
    told = wayfi("closures", saved)
    assert told.exit_code == 0
    assert told.stdout.count("accepted") == 7
    assert "1 that were refused are not shown (--all)" in told.stdout
    assert "inlier ratio 0.30" in wayfi("closures", saved, "--all").stdout
    found = one_object(wayfi("closures", saved, "--json"))
    assert [c["number"] for c in found["closures"]] == list(range(8))
    assert found["map_version"] == 1
    assert found["closures"][7]["residual_m"] > 0.5


def test_vetoes_and_restores_of_one_call_are_one_edit(saved: Path) -> None:
    found = one_object(wayfi("closures", saved, "--veto", "7", "--veto", "2", "--json"))
    assert [c["verdict"] for c in found["closures"]] == ["refused", "accepted", "vetoed", *["accepted"] * 4, "vetoed"]
    told = wayfi("closures", saved, "--restore", "2", "--veto", "3")
    assert "version 3, moved by" in told.stdout
    assert load_map(saved).building.vetoed == {3, 7}


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (("--veto", "99"), "there is no closure 99 in this map: they are 0 to 7"),
        (("--veto", "0"), "closure 0 is not part of the map (refused: inlier ratio 0.30 under 0.6): nothing to veto"),
        (("--restore", "2"), "closure 2 is not vetoed: there is nothing to restore"),
    ],
)
def test_what_cannot_be_edited_is_one_line(saved: Path, options: tuple[str, str], told: str) -> None:
    done = wayfi("closures", saved, *options)
    assert (done.exit_code, done.stderr.strip()) == (1, f"wayfi: {told}")


def test_where_there_is_no_map_it_is_told(tmp_path: Path) -> None:
    for command in (("closures", tmp_path), ("merge", tmp_path, tmp_path, "--out", tmp_path / "c")):
        done = wayfi(*command)
        assert (done.exit_code, done.stderr.count("\n")) == (1, 1)
        assert "holds no map" in done.stderr


def test_align_tells_how_far_each_fix_is_off(saved: Path, tmp_path: Path) -> None:
    building = load_map(saved).building
    stamps = np.array([building.keyframes[k].stamp_ns for k in (0, 20, 40, 60)])
    fixes = building.poses[[0, 20, 40, 60]] + [10.0, 20.0, 0.0]
    fixes[3, 0] += 5.0
    write_tum(tmp_path / "fixes.tum", stamps, fixes)
    found = one_object(wayfi("align", saved, "--fixes", tmp_path / "fixes.tum", "--out", tmp_path / "plan", "--json"))
    assert found["used"] == [True, True, True, False]
    assert found["residuals_m"][3] == pytest.approx(5.0, abs=0.1)
    assert found["T_plan_map"] == pytest.approx([10.0, 20.0, 0.0], abs=1e-6)
    told = wayfi("align", tmp_path / "plan", "--fixes", tmp_path / "fixes.tum")
    assert "moved by 0.000 m" in told.stdout


def test_merge_tells_what_it_rests_on_and_why_it_refuses(tmp_path: Path) -> None:
    back = around(60.0, 60.0, back=True, inset_m=5.0)
    save_map(tmp_path / "a", map_of(hall(), around(0.0, 96.0)))
    save_map(tmp_path / "b", map_of(hall(), back, seed=1))
    save_map(tmp_path / "other", map_of(hall(name="bb"), back, seed=1))
    found = one_object(wayfi("merge", tmp_path / "a", tmp_path / "b", "--out", tmp_path / "c", "--json"))
    assert found["checks"] >= 5
    assert found["map_id"] == load_map(tmp_path / "c").map_id
    refused = wayfi("merge", tmp_path / "a", tmp_path / "other", "--out", tmp_path / "d")
    assert refused.exit_code == 1
    assert refused.stderr.startswith("wayfi: no place of one map sounds like one of the other")
    assert not (tmp_path / "d").exists()
