"""A map that is saved as it grows: what was saved before is not written again."""

import pickle
from pathlib import Path

import pytest
from building_maps.made_up import grown, made_up_map

from wayfi.frontends.maps.building_map import BuildingMap
from wayfi.recordings.map.loading import load_map
from wayfi.recordings.map.saving import MapSaver, name_of_map, save_map

FULL = {"scans_0000.parquet", "scans_0001.parquet", "factors_0000.parquet"}


@pytest.fixture(scope="module")
def building() -> BuildingMap:
    return made_up_map(700, beams=8)


def inodes(folder: Path) -> dict[str, tuple[int, int]]:
    """What tells a file that was written again: each is a new one."""
    found = {path.name: path.stat() for path in folder.glob("*.parquet")}
    return {name: (stat.st_ino, stat.st_mtime_ns) for name, stat in found.items()}


def kept(folder: Path, before: dict[str, tuple[int, int]]) -> set[str]:
    return {name for name, inode in inodes(folder).items() if before.get(name) == inode}


def test_full_parts_are_left_and_the_rest_is_written(building: BuildingMap, tmp_path: Path) -> None:
    saver = MapSaver(tmp_path)
    saver.save(grown(building, 600))
    before = inodes(tmp_path)
    saver.save(building)
    assert kept(tmp_path, before) == FULL
    saver.save(building)
    assert kept(tmp_path, before) == FULL
    again = inodes(tmp_path)
    saver.save(building)
    assert set(again) - kept(tmp_path, again) == {
        "keyframes.parquet",
        "access_points.parquet",
        "grid.parquet",
        "grid_floor1.parquet",
    }


def test_a_saver_that_was_pickled_with_its_map_knows_what_is_saved(building: BuildingMap, tmp_path: Path) -> None:
    saver = MapSaver(tmp_path)
    saver.save(building)
    before = inodes(tmp_path)
    saver, building = pickle.loads(pickle.dumps((saver, building)))
    saver.save(building)
    assert kept(tmp_path, before) >= FULL
    assert load_map(tmp_path).warnings == ()


def test_a_scan_that_is_forgotten_is_not_kept(building: BuildingMap, tmp_path: Path) -> None:
    saver = MapSaver(tmp_path)
    saver.save(building)
    saver.save(made_up_map(700, seed=1, beams=8))
    save_map(tmp_path / "whole", made_up_map(700, seed=1, beams=8))
    assert (tmp_path / "scans_0000.parquet").read_bytes() == (tmp_path / "whole" / "scans_0000.parquet").read_bytes()


def test_what_another_has_saved_meanwhile_is_replaced_whole(building: BuildingMap, tmp_path: Path) -> None:
    saver = MapSaver(tmp_path)
    name = saver.save(building)
    other = save_map(tmp_path, made_up_map(300, seed=2), former=name)
    last = saver.save(building)
    assert (other.map_version, last.map_version, last.map_id) == (2, 3, name.map_id)
    assert len(load_map(tmp_path).building.keyframes) == 700
    assert load_map(tmp_path).warnings == ()


def test_parts_of_a_map_that_was_longer_are_deleted(building: BuildingMap, tmp_path: Path) -> None:
    save_map(tmp_path, building)
    save_map(tmp_path, grown(building, 100))
    assert {path.name for path in tmp_path.glob("scans_*")} == {"scans_0000.parquet"}


def test_the_name_of_a_map_is_told_if_there_is_one(building: BuildingMap, tmp_path: Path) -> None:
    assert name_of_map(tmp_path) is None
    assert save_map(tmp_path, building) == name_of_map(tmp_path)
