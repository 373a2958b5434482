"""`wayfi radio` on saved maps."""

from pathlib import Path

import numpy as np
import pytest
from building_maps.heard import heard_map, level_of, rounds
from command_line import one_object, wayfi

from wayfi.recordings.map.saving import save_map

NAME = "a0:00:00:00:00:01"


@pytest.fixture(scope="module")
def replayed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a map in it, as a replay leaves it."""
    chance, xy, folder = np.random.default_rng(1), rounds(1), tmp_path_factory.mktemp("replay")
    levels = {NAME: level_of([10, 1], xy, chance), "a0:00:00:00:99:01": np.full(len(xy), -40.0)}
    save_map(folder / "map", heard_map(xy, levels, chance))
    return folder


def test_a_replay_and_its_map_give_the_same_tables(replayed: Path, tmp_path: Path) -> None:
    for name, path in (("a", replayed), ("b", replayed / "map")):
        assert wayfi("radio", path, "--out", tmp_path / name).exit_code == 0
    for table in ("access_points.csv", "levels.csv", "coverage.csv", "coverage.tif"):
        assert (tmp_path / "a" / table).read_bytes() == (tmp_path / "b" / table).read_bytes()


def test_it_says_what_was_found_in_a_few_lines_or_as_json(replayed: Path, tmp_path: Path) -> None:
    said = wayfi("radio", replayed, "--out", tmp_path).stdout.splitlines()
    assert said[0].startswith("2 access points with 2 BSSIDs: 1 are placed to 8 m")
    assert "a0:00:00:00:99:01 rides on the robot: heard alike everywhere" in said
    assert len(said) < 8
    assert wayfi("radio", replayed, "--out", tmp_path, "--quiet").stdout == ""
    found = one_object(wayfi("radio", replayed, "--out", tmp_path, "--json"))
    assert (found["access_points"], found["stands"], found["carried"]) == (2, 1, 1)


def test_what_is_usable_is_a_setting(replayed: Path, tmp_path: Path) -> None:
    found = [
        one_object(wayfi("radio", replayed, "--out", tmp_path, "--json", "--set", f"radio.usable_dbm={level}"))
        for level in (-85, -50)
    ]
    assert found[0]["holes_square_metres"] < found[1]["holes_square_metres"]


def test_a_map_without_wifi_and_a_folder_without_a_map_exit_with_1_in_one_line(tmp_path: Path) -> None:
    save_map(tmp_path / "deaf", heard_map(rounds(1), {}, np.random.default_rng(0)))
    for folder, told in ((tmp_path / "deaf", "no WiFi was heard on floor 0"), (tmp_path, str(tmp_path))):
        done = wayfi("radio", folder, "--out", tmp_path / "out")
        assert done.exit_code == 1
        (line,) = done.stderr.splitlines()
        assert told in line
    assert not (tmp_path / "out").exists()
