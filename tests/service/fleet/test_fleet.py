"""Three daemons and one that merges, on loopback: one map, in which each robot knows its place, whatever breaks off."""

import json
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from buildings.robots import drive
from buildings.storey import ROUTE, storey
from drives import Simulated, write
from live.daemons import LOSSLESS, Running, asked_for, message_of, running
from live.loopback import eventually
from live.runs import stamp_ns

from wayfi.backend.pose2 import Floats, Pose2, compose_all
from wayfi.recordings.map.loading import load_map
from wayfi.recordings.map.saving import name_of_map
from wayfi.recordings.ros.messages import OCCUPANCY_GRID, POSE_WITH_COVARIANCE, TF_MESSAGE
from wayfi.service.fleet.fleet_file import Fleet, read_fleet
from wayfi.service.fleet.robot_folders import MAP, robot_folder

pytestmark = pytest.mark.slow
ROUTES = (ROUTE, ROUTE[::-1], (*ROUTE[3:], *ROUTE[:4]))
FIRST_SHARE = 0.85  # of a drive, before the robots are looked for
RATE = 6.0  # times real time
OFTEN = "zenoh.fleet_every_s=0.3"
ORIGIN = Pose2(*ROUTE[0], 0.0)  # of the first robot's map, which is the common one's


@dataclass
class Member:
    """A robot of the fleet: its daemon, its drive, and the two parts of it."""

    daemon: Running
    made: Simulated
    begin: Path
    end: Path

    def map(self) -> None:
        """Drive, and have the map saved."""
        self.daemon.publish(self.begin, None)
        self.daemon.settle()
        (reply,) = asked_for(self.daemon.session, self.daemon.key("wayfi/command/save"))
        assert json.loads(reply)["ok"], reply

    def errors_m(self) -> Floats:
        """How far the poses published in the common map are from the truth."""
        poses = [message_of(data, POSE_WITH_COVARIANCE) for data in self.daemon.samples["wayfi/common/pose"]]
        assert {pose.header.frame_id for pose in poses} == {"common_map"}
        stamps = np.array([stamp_ns(pose.header) for pose in poses])
        found = np.array([(p.pose.pose.position.x, p.pose.pose.position.y, 0.0) for p in poses])
        true = self.made.truth.at(stamps)
        return np.hypot(*(compose_all(ORIGIN.array(), found) - true)[:, :2].T)


def split(made: Simulated, folder: Path) -> tuple[Path, Path]:
    """The two parts of a drive as recordings."""
    folder.mkdir()
    last = made.arrivals[-1].at_ns - made.arrivals[0].at_ns
    first = [a for a in made.arrivals if a.at_ns - made.arrivals[0].at_ns < FIRST_SHARE * last]
    return write(folder / "a.mcap", first), write(folder / "b.mcap", made.arrivals[len(first) :])


def member(opened: ExitStack, folder: Path, prefix: str, made: Simulated) -> Member:
    begin, end = split(made, folder / prefix)
    daemon = opened.enter_context(
        running(folder / prefix / "runs", LOSSLESS, OFTEN, "rerun.enabled=false", prefix=prefix)
    )
    daemon.collect("wayfi/common/pose", "wayfi/common/map", "wayfi/tf")
    return Member(daemon, made, begin, end)


def merger(opened: ExitStack, directory: Path, robots: Sequence[Member]) -> Running:
    """A merging daemon that is linked to the robots."""
    endpoints = json.dumps([robot.daemon.config.listen[0] for robot in robots])
    merging = running(directory, OFTEN, f"zenoh.connect={endpoints}", flags=("--merge",), prefix="office")
    return opened.enter_context(merging)


def fleet_of(merging: Running) -> Fleet:
    return read_fleet(merging.directory / MAP)


def joined(merging: Running) -> set[str]:
    return {m.robot for m in fleet_of(merging).members if m.T_common_map is not None}


@pytest.fixture(scope="module")
def opened() -> Iterator[ExitStack]:
    with ExitStack() as stack:
        yield stack


@pytest.fixture(scope="module")
def robots(opened: ExitStack, tmp_path_factory: pytest.TempPathFactory) -> list[Member]:
    """Three robots that have driven before anybody merged."""
    folder = tmp_path_factory.mktemp("fleet")
    drives = [drive(storey(), route, day=day) for day, route in enumerate(ROUTES)]
    members = [member(opened, folder, f"robot{n + 1}", made) for n, made in enumerate(drives)]
    for one in members:
        one.map()
    return members


@pytest.fixture(scope="module")
def merging(opened: ExitStack, robots: list[Member], tmp_path_factory: pytest.TempPathFactory) -> Running:
    """The merging daemon, which comes late and has joined all three."""
    merging = merger(opened, tmp_path_factory.mktemp("merging") / "fleet", robots)
    eventually(lambda: len(joined(merging)) == 3)
    return merging


def test_what_was_driven_before_is_fetched_and_lies_where_it_was_driven(merging: Running, robots: list[Member]) -> None:
    starts = {f"robot{n + 1}": Pose2.of(one.made.truth.poses[0]) for n, one in enumerate(robots)}
    for known in fleet_of(merging).members:
        place = Pose2(*known.T_common_map)
        true = ORIGIN.inverse() @ starts[known.robot]
        assert np.hypot(place.x - true.x, place.y - true.y) < 0.1
        assert abs(true.between(place).theta) < 0.02
    assert load_map(merging.directory / MAP).warnings == ()


def test_each_robot_gets_the_common_map_and_its_own_place_in_it(merging: Running, robots: list[Member]) -> None:
    for one in robots:
        eventually(
            lambda one=one: name_of_map(one.daemon.folder / "common_map") == name_of_map(merging.directory / MAP)
        )
        eventually(lambda one=one: one.daemon.status().get("common_map"))
        one.daemon.publish(one.end, RATE)
        eventually(lambda one=one: len(one.daemon.samples["wayfi/common/pose"]) > 100)
        assert one.errors_m().max() < 0.15
        assert message_of(one.daemon.samples["wayfi/common/map"][-1], OCCUPANCY_GRID).header.frame_id == "common_map"
        transforms = message_of(one.daemon.samples["wayfi/tf"][-1], TF_MESSAGE).transforms
        assert [(t.header.frame_id, t.child_frame_id) for t in transforms] == [("map", "odom"), ("common_map", "map")]


def test_a_merging_daemon_that_was_killed_goes_on_and_a_robot_that_left_stays_in_the_map(
    merging: Running, robots: list[Member]
) -> None:
    before = name_of_map(merging.directory / MAP)
    merging.kill()
    left = robots[2].daemon
    assert left.stop() == 0
    merging.start_again()
    eventually(lambda: name_of_map(merging.directory / MAP).map_version > before.map_version)
    assert name_of_map(merging.directory / MAP).map_id == before.map_id
    assert joined(merging) == {"robot1", "robot2", "robot3"}


def test_a_robot_that_comes_back_brings_the_end_of_its_last_run(merging: Running, robots: list[Member]) -> None:
    back = robots[2].daemon
    end = load_map(back.folder).building.keyframes[-1].stamp_ns
    fetched = robot_folder(merging.directory, "robot3", back.folder.name)
    assert load_map(fetched).building.keyframes[-1].stamp_ns < end
    back.start_again("--fresh")
    eventually(lambda: load_map(fetched).building.keyframes[-1].stamp_ns == end)
