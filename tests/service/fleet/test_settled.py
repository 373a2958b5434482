"""Runs that have ended are joined once: rounds cost the same on every day, and the map grows with the area alone."""

from pathlib import Path

import numpy as np
import pytest
from building_maps.halls import around, hall, map_of

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.maps.building_map import BuildingMap
from wayfi.frontends.merging import common_map
from wayfi.frontends.merging.merging import Merged, merge
from wayfi.frontends.slam_config import SlamConfig
from wayfi.recordings.files.map_folder import MANIFEST, MapError
from wayfi.recordings.map.loading import load_map
from wayfi.recordings.map.manifest import MapName
from wayfi.recordings.map.saving import name_of_map, save_map
from wayfi.service.config import Config
from wayfi.service.fleet import merging_process, settled
from wayfi.service.fleet.fleet_file import Fleet, Member
from wayfi.service.fleet.merging_process import join_maps
from wayfi.service.fleet.robot_folders import MAP, SETTLED, robot_folder

CONFIG = Config()
HALL, FOREIGN = hall(), hall(9, "bb")
WAY = around(0.0, 60.0)


class Work:
    """Counts the merges, and the keyframes that are compared, since it was asked last."""

    def __init__(self) -> None:
        self.merges = self.keyframes = 0

    def merge(self, a: BuildingMap, b: BuildingMap, config: SlamConfig) -> Merged:
        self.merges += 1
        self.keyframes += len(a.keyframes) + len(b.keyframes)
        return merge(a, b, config)

    def taken(self) -> tuple[int, int]:
        counted, self.merges, self.keyframes = (self.merges, self.keyframes), 0, 0
        return counted


@pytest.fixture
def work(monkeypatch: pytest.MonkeyPatch) -> Work:
    counted = Work()
    monkeypatch.setattr(common_map, "merge", counted.merge)
    return counted


def drive(day: int) -> BuildingMap:
    """A drive around the hall, which begins a little further each day."""
    return map_of(HALL, around(3.0 * day, 60.0), seed=day)


def bring(directory: Path, robot: str, run: str, building: BuildingMap, former: MapName | None = None) -> Path:
    folder = robot_folder(directory, robot, run)
    save_map(folder, building, former=former)
    return folder


def known(fleet: Fleet, robot: str, run: str) -> Member:
    (member,) = [m for m in fleet.members if (m.robot, m.run) == (robot, run)]
    return member


def off_m(member: Member, day: int, first_day: int = 0) -> float:
    """By how much the frame of a day's map is off, where the common one begins with that of another day."""
    assert member.T_common_map is not None
    begins = [Pose2.of(around(3.0 * each, 60.0)[0]) for each in (first_day, day)]
    true = begins[0].between(begins[1])
    return float(np.hypot(true.x - member.T_common_map[0], true.y - member.T_common_map[1]))


def test_the_work_of_a_round_and_the_map_stay_as_they_are_day_after_day(tmp_path: Path, work: Work) -> None:
    sizes, counts = [], []
    for day in range(6):
        bring(tmp_path, "robot1", f"day{day}", drive(day))
        fleet = join_maps(tmp_path, CONFIG)
        counts.append(work.taken())
        sizes.append(len(load_map(tmp_path / MAP).building.keyframes))
    assert [merges for merges, _ in counts[3:]] == [3, 3, 3]  # of the run that ended, and of the two that may grow
    assert counts[-1][1] < 1.1 * counts[3][1]
    assert sizes[-1] < 1.5 * 60
    assert len(fleet.members) == 6
    assert all(off_m(known(fleet, "robot1", f"day{day}"), day) < 0.1 for day in range(6))
    for merges in (2, 1):  # the last run that ended is settled, then there is but the newest to be joined
        fleet = join_maps(tmp_path, CONFIG)
        assert work.taken()[0] == merges
    assert [m.settled_in > 0 for m in fleet.members] == [True] * 5 + [False]


def test_of_the_copy_of_a_settled_run_the_manifest_is_kept_and_a_later_version_is_joined(tmp_path: Path) -> None:
    folder = bring(tmp_path, "robot1", "day0", drive(0))
    join_maps(tmp_path, CONFIG)
    bring(tmp_path, "robot1", "day1", drive(1))
    for _ in range(2):
        join_maps(tmp_path, CONFIG)
    assert [path.name for path in folder.iterdir()] == [MANIFEST]
    longer = map_of(HALL, around(0.0, 80.0))
    bring(tmp_path, "robot1", "day0", longer, name_of_map(folder))
    fleet = join_maps(tmp_path, CONFIG)
    assert known(fleet, "robot1", "day0").map_version == 2
    assert off_m(known(fleet, "robot1", "day0"), 0) < 0.1


def test_the_frame_stays_though_the_run_of_another_robot_ends_first(tmp_path: Path) -> None:
    bring(tmp_path, "robot1", "day0", drive(0))
    bring(tmp_path, "robot2", "day0", drive(2))
    join_maps(tmp_path, CONFIG)
    bring(tmp_path, "robot2", "day1", drive(3))
    for _ in range(2):
        fleet = join_maps(tmp_path, CONFIG)
    assert known(fleet, "robot2", "day0").settled_in == 1
    for robot, run, day in (("robot1", "day0", 0), ("robot2", "day0", 2), ("robot2", "day1", 3)):
        assert off_m(known(fleet, robot, run), day) < 0.1


def test_one_that_is_killed_before_the_settled_map_is_saved_settles_it_the_next_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bring(tmp_path, "robot1", "day0", drive(0))
    join_maps(tmp_path, CONFIG)
    bring(tmp_path, "robot1", "day1", drive(1))
    join_maps(tmp_path, CONFIG)
    with monkeypatch.context() as broken:
        broken.setattr(settled, "save_map", full_disk)
        with pytest.raises(MapError):
            join_maps(tmp_path, CONFIG)
    assert (tmp_path / SETTLED / "fleet.json").exists()
    assert settled.read_settled(tmp_path).members == ()
    fleet = join_maps(tmp_path, CONFIG)
    assert [(m.run, m.settled_in) for m in fleet.members] == [("day0", 1), ("day1", 0)]


def full_disk(*_: object) -> None:
    raise MapError("no space left on device")


def test_of_the_runs_that_do_not_join_the_newest_few_are_tried_again(tmp_path: Path, work: Work) -> None:
    bring(tmp_path, "robot1", "day0", drive(0))
    for day in range(5):
        bring(tmp_path, "robot2", f"day{day}", map_of(FOREIGN, WAY, seed=day))
    fleet = join_maps(tmp_path, CONFIG)
    assert work.taken()[0] == 1 + merging_process.TRIED_AGAIN
    assert {m.run for m in fleet.members if m.robot == "robot2"} == {"day2", "day3", "day4"}
    assert all("sounds like" in m.why for m in fleet.members if m.robot == "robot2")


def test_a_robot_that_goes_on_with_the_common_map_adds_what_it_has_seen_alone(tmp_path: Path, work: Work) -> None:
    bring(tmp_path, "robot1", "day0", drive(0))
    join_maps(tmp_path, CONFIG)
    common = load_map(tmp_path / MAP)
    on = merge(common.building, drive(4), CONFIG).building
    bring(tmp_path, "robot2", "day1", on, common.name)
    work.taken()
    fleet = join_maps(tmp_path, CONFIG)
    assert work.taken() == (1, 60 + 60)
    assert off_m(known(fleet, "robot2", "day1"), 0) < 0.1
