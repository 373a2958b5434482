"""A settled map that is damaged is told of once and made anew; the rounds go on."""

from pathlib import Path

import pytest
from building_maps.halls import around, hall, map_of

from wayfi.recordings.files.map_folder import KEYFRAMES, MANIFEST, delete_map
from wayfi.recordings.map.loading import load_map
from wayfi.recordings.map.saving import save_map
from wayfi.service.config import Config
from wayfi.service.fleet.fleet_file import FLEET, Fleet, Member
from wayfi.service.fleet.merging_process import join_maps
from wayfi.service.fleet.robot_folders import MAP, SET_ASIDE, SETTLED, robot_folder
from wayfi.service.fleet.settled import read_settled

CONFIG = Config()
HALL = hall()
DAMAGES = ("cut keyframes", "no keyframes", "cut manifest", "no manifest", "cut list", "no list", "empty list")


def bring(directory: Path, run: str, first_m: float) -> Path:
    """A drive of the one robot around the hall, as it was fetched."""
    folder = robot_folder(directory, "robot", run)
    save_map(folder, map_of(HALL, around(first_m, 60.0), seed=int(first_m)))
    return folder


def settle(directory: Path) -> Path:
    """Have the first of two runs settled; returns the folder of its copy."""
    first = bring(directory, "day0", 0.0)
    join_maps(directory, CONFIG)
    bring(directory, "day1", 3.0)
    for _ in range(2):
        join_maps(directory, CONFIG)
    assert [path.name for path in first.iterdir()] == [MANIFEST]
    return first


def damage(folder: Path, what: str) -> None:
    how, name = what.split()
    path = folder / {"keyframes": KEYFRAMES, "manifest": MANIFEST, "list": FLEET}[name]
    if how == "no":
        path.unlink()
    else:
        path.write_text(Fleet().to_json() if how == "empty" else path.read_text(errors="replace")[:100])


def places(fleet: Fleet) -> dict[str, tuple[float, float, float] | None]:
    return {member.run: member.T_common_map for member in fleet.members}


def near(one: Member, before: dict[str, tuple[float, float, float] | None]) -> bool:
    return one.T_common_map == pytest.approx(before[one.run], abs=0.1)


@pytest.mark.parametrize("what", DAMAGES)
def test_the_common_map_takes_its_place_and_a_line_tells_it_once(
    what: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    settle(tmp_path)
    before = places(join_maps(tmp_path, CONFIG))
    size = len(load_map(tmp_path / MAP).building.keyframes)
    damage(tmp_path / SETTLED, what)
    capsys.readouterr()
    fleets = [join_maps(tmp_path, CONFIG) for _ in range(2)]
    (line,) = capsys.readouterr().err.splitlines()
    assert str(tmp_path / SETTLED) in line
    assert line.endswith(f"is made anew of the common map, and what was there is in {SET_ASIDE}")
    assert all(near(member, before) for fleet in fleets for member in fleet.members)
    assert all(places(fleet).keys() == {"day0", "day1"} for fleet in fleets)
    assert len(load_map(tmp_path / MAP).building.keyframes) < 1.2 * size
    assert (tmp_path / SET_ASIDE).is_dir()


def test_where_the_common_map_is_damaged_too_what_was_settled_is_fetched_again(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    first = settle(tmp_path)
    before = places(join_maps(tmp_path, CONFIG))
    damage(tmp_path / SETTLED, "cut keyframes")
    damage(tmp_path / MAP, "cut keyframes")
    capsys.readouterr()
    fleet = join_maps(tmp_path, CONFIG)
    (line,) = [line for line in capsys.readouterr().err.splitlines() if SET_ASIDE in line]
    assert "is made anew of what robots still serve" in line
    assert [member.run for member in fleet.members] == ["day1"]
    assert near(fleet.members[0], before)
    assert not any(first.iterdir())
    bring(tmp_path, "day0", 0.0)
    for _ in range(2):
        fleet = join_maps(tmp_path, CONFIG)
    assert all(near(member, before) for member in fleet.members)
    assert {member.run for member in read_settled(tmp_path).members} == {"day0"}


def test_nothing_is_left_of_copies_of_what_is_settled_nowhere(tmp_path: Path) -> None:
    """The folder of the settled map was deleted, and no map is whole."""
    first = settle(tmp_path)
    delete_map(tmp_path / SETTLED)
    delete_map(robot_folder(tmp_path, "robot", "day1"))
    assert join_maps(tmp_path, CONFIG) == Fleet()
    assert not any(first.iterdir())
