"""A settled map that is damaged is told of once and made anew; the rounds go on."""

import shutil
from collections.abc import Mapping
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
SCANS = "scans_0000.parquet"
DAMAGES = (
    "cut keyframes",
    "no keyframes",
    "cut scans",
    "cut manifest",
    "no manifest",
    "cut list",
    "no list",
    "empty list",
)


Places = Mapping[str, tuple[float, float, float] | None]


def bring(directory: Path, run: str, first_m: float) -> Path:
    """A drive of the one robot around the hall, as it was fetched."""
    folder = robot_folder(directory, "robot", run)
    save_map(folder, map_of(HALL, around(first_m, 60.0), seed=int(first_m)))
    return folder


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Fleet]:
    """The directory of a merging daemon in which the first of two runs is settled, and the fleet."""
    directory = tmp_path_factory.mktemp("merging")
    first = bring(directory, "day0", 0.0)
    join_maps(directory, CONFIG)
    bring(directory, "day1", 3.0)
    join_maps(directory, CONFIG)
    fleet = join_maps(directory, CONFIG)
    assert [path.name for path in first.iterdir()] == [MANIFEST]
    return directory, fleet


@pytest.fixture
def before(made: tuple[Path, Fleet]) -> Places:
    """Where the runs lay in the common map of `directory`."""
    return places(made[1])


@pytest.fixture
def directory(made: tuple[Path, Fleet], tmp_path: Path) -> Path:
    """A copy of that directory."""
    return shutil.copytree(made[0], tmp_path / "merging")


def damage(folder: Path, what: str) -> None:
    how, name = what.split()
    path = folder / {"keyframes": KEYFRAMES, "scans": SCANS, "manifest": MANIFEST, "list": FLEET}[name]
    if how == "no":
        path.unlink()
    else:
        path.write_text(Fleet().to_json() if how == "empty" else path.read_text(errors="replace")[:100])


def places(fleet: Fleet) -> Places:
    return {member.run: member.T_common_map for member in fleet.members}


def near(one: Member, before: Places) -> bool:
    return one.T_common_map == pytest.approx(before[one.run], abs=0.1)


@pytest.mark.parametrize("what", DAMAGES)
def test_the_common_map_takes_its_place_and_a_line_tells_it_once(
    what: str, directory: Path, before: Places, capsys: pytest.CaptureFixture[str]
) -> None:
    size = len(load_map(directory / MAP).building.keyframes)
    damage(directory / SETTLED, what)
    capsys.readouterr()
    fleets = [join_maps(directory, CONFIG) for _ in range(2)]
    (line,) = capsys.readouterr().err.splitlines()
    assert str(directory / SETTLED) in line
    assert line.endswith(f"is made anew of the common map, and what was there is in {SET_ASIDE}")
    assert all(near(member, before) for fleet in fleets for member in fleet.members)
    assert all(places(fleet).keys() == {"day0", "day1"} for fleet in fleets)
    assert len(load_map(directory / MAP).building.keyframes) < 1.2 * size
    assert (directory / SET_ASIDE).is_dir()


def test_a_run_that_goes_on_is_joined_again_whole_and_counts_once(directory: Path, before: Places) -> None:
    """Half of its keyframes were in the common map when that took the place of the settled one."""
    damage(directory / SETTLED, "cut keyframes")
    join_maps(directory, CONFIG)
    settled = read_settled(directory)
    assert {member.run for member in settled.members} == {"day0"}
    assert settled.building is not None
    assert {keyframe.session for keyframe in settled.building.keyframes} == {0}
    save_map(robot_folder(directory, "robot", "day1"), map_of(HALL, around(3.0, 90.0), seed=3))
    fleet = join_maps(directory, CONFIG)
    assert [member.run for member in fleet.members] == ["day0", "day1"]
    assert all(near(member, before) for member in fleet.members)
    assert {k.session for k in load_map(directory / MAP).building.keyframes} <= {0, 1}


def test_where_the_common_map_is_damaged_too_what_was_settled_is_fetched_again(
    directory: Path, before: Places, capsys: pytest.CaptureFixture[str]
) -> None:
    damage(directory / SETTLED, "cut keyframes")
    damage(directory / MAP, "cut keyframes")
    capsys.readouterr()
    fleet = join_maps(directory, CONFIG)
    (line,) = [line for line in capsys.readouterr().err.splitlines() if SET_ASIDE in line]
    assert "is made anew of what robots still serve" in line
    assert [member.run for member in fleet.members] == ["day1"]
    assert near(fleet.members[0], before)
    assert not any(robot_folder(directory, "robot", "day0").iterdir())
    bring(directory, "day0", 0.0)
    for _ in range(2):
        fleet = join_maps(directory, CONFIG)
    assert all(near(member, before) for member in fleet.members)
    assert {member.run for member in read_settled(directory).members} == {"day0"}


def test_nothing_is_left_of_copies_of_what_is_settled_nowhere(directory: Path) -> None:
    """The folder of the settled map was deleted, and no map is whole."""
    delete_map(directory / SETTLED)
    delete_map(robot_folder(directory, "robot", "day1"))
    assert join_maps(directory, CONFIG) == Fleet()
    assert not any(robot_folder(directory, "robot", "day0").iterdir())
