"""Robots in a hall that is mapped, in one that is not, and in one that looks alike from both ends."""

from dataclasses import replace

import numpy as np
import pytest
from building_maps.halls import ACCESS_POINTS, LENGTH_M, WIDTH_M, Hall, around, hall, map_of
from rooms import see

from wayfi.backend.graph.health import State
from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.localization.local_track import KEPT
from wayfi.frontends.maps.building_map import BuildingMap
from wayfi.frontends.measurements import SECOND_NS
from wayfi.frontends.modes.localization_core import LocalizationCore
from wayfi.frontends.odometry.driven_path import PathPoint
from wayfi.frontends.odometry.live_pose import Anchor
from wayfi.frontends.scan_points import PlacedScan
from wayfi.frontends.slam_config import SlamConfig
from wayfi.frontends.timer import untimed
from wayfi.frontends.wifi.readings import PlacedWifiScan
from wayfi.recordings.simulation.surfaces import box

GO_ON = 20  # messages of odometry between two keyframes, a metre apart
ROUND = around(0.0, 96.0)
CLAIMED = (State.TRACKING, State.UNCERTAIN)
BARE = Hall(box(0.0, 0.0, 40.0, 24.0), "aa", np.zeros((ACCESS_POINTS, 2)))


class Robot:
    """A robot that is switched on in a hall, with the map of one."""

    def __init__(self, building: BuildingMap, laser: bool = True, wifi: bool = True, seed: int = 7) -> None:
        self.core = LocalizationCore(SlamConfig(), building.calibration, untimed, building)
        self.rng = np.random.default_rng(seed)
        self.laser, self.wifi = laser, wifi
        self.T_odom_base, self.path_m, self.seconds = Pose2(), 0.0, 0

    def drive(self, place: Hall, truth: Floats) -> list[tuple[Pose2, Anchor | None]]:
        """Drive along (n, 3) poses in the hall; returns at each the truth and what is claimed then."""
        seen: list[tuple[Pose2, Anchor | None]] = []
        before = Pose2.of(truth[0])
        for pose in truth:
            T, step = Pose2.of(pose), before.between(Pose2.of(pose))
            noise = [0.01, 0.01, 0.005] * self.rng.standard_normal(3)
            self.T_odom_base = self.T_odom_base @ Pose2.of(step.array() + noise)
            self.path_m += step.distance(Pose2())
            self._keyframe(place, T)
            seen.append((T, self.core.anchor()))
            before = T
        return seen

    def _keyframe(self, place: Hall, T: Pose2) -> None:
        scan = see(place.walls, T, self.rng) if self.laser else None
        self.core.add_keyframe(self._point, PlacedScan(scan, scan.points.astype(np.float32)) if scan else None)
        self.hear(place, T)

    def hear(self, place: Hall, T: Pose2) -> None:
        """Hear what is heard at a pose in a hall, and go on for a second."""
        if self.wifi:
            scan = PlacedWifiScan("phone", self._point, place.heard(T, self.rng), np.full(ACCESS_POINTS, np.nan))
            self.core.add_wifi(self._point.stamp_ns, scan)
        for _ in range(GO_ON):
            self.core.go_on(self._point.stamp_ns)
        self.seconds += 1

    @property
    def _point(self) -> PathPoint:
        return PathPoint(self.seconds * SECOND_NS, self.T_odom_base, self.path_m)


def errors_m(seen: list[tuple[Pose2, Anchor | None]]) -> list[float]:
    """How far off what is claimed is; the map's frame is that of the first pose of its drive."""
    origin = Pose2.of(ROUND[0])
    return [origin.between(T).distance(anchor.T_map_base) for T, anchor in seen if anchor is not None]


@pytest.fixture(scope="module")
def building() -> BuildingMap:
    return map_of(hall(), ROUND)


@pytest.mark.parametrize("back", [False, True])
@pytest.mark.parametrize("wifi", [True, False])
def test_a_robot_that_is_switched_on_anywhere_is_found_within_some_metres(
    building: BuildingMap, wifi: bool, back: bool
) -> None:
    robot = Robot(building, wifi=wifi)
    seen = robot.drive(hall(), around(30.0, 12.0, back, inset_m=5.0))
    assert seen[9][1] is not None
    assert seen[-1][1] is not None
    assert seen[-1][1].state is State.TRACKING
    assert max(errors_m(seen)) < 0.15


@pytest.mark.parametrize(
    ("wifi", "size", "first_m"), [(True, 1.0, 10.0), (False, 0.9, 10.0), (False, 0.9, 25.0), (False, 0.9, 35.0)]
)
def test_a_robot_in_another_hall_is_never_claimed_to_be_in_this_one(
    building: BuildingMap, wifi: bool, size: float, first_m: float
) -> None:
    robot, other = Robot(building, wifi=wifi), hall(5, "bb")
    seen = robot.drive(replace(other, walls=size * other.walls), around(first_m, 30.0, inset_m=6.0))
    assert errors_m(seen) == []
    assert robot.core.anchor() is None


def test_what_looks_alike_from_both_ends_is_not_claimed_without_wifi() -> None:
    robot = Robot(map_of(BARE, ROUND), wifi=False)
    assert errors_m(robot.drive(BARE, around(5.0, 60.0))) == []


def test_a_robot_that_is_carried_elsewhere_is_given_up_and_found_again(building: BuildingMap) -> None:
    robot = Robot(building)
    robot.drive(hall(), around(0.0, 12.0))
    assert robot.core.anchor() is not None
    carried = robot.drive(hall(), around(60.0, 20.0))
    assert max(errors_m(carried[6:])) < 0.15
    assert carried[-1][1] is not None


def test_wifi_that_names_another_place_is_believed_after_some_metres_of_it(building: BuildingMap) -> None:
    """The access points are those of the hall turned by half: what is heard tells of the place opposite."""
    robot = Robot(building)
    robot.drive(hall(), around(0.0, 12.0))
    opposite = replace(hall(), places=np.array([LENGTH_M, WIDTH_M]) - hall().places)
    robot.drive(opposite, around(12.0, 3.0))
    for _ in range(6):
        robot.hear(opposite, Pose2.of(around(14.0, 1.0)[0]))
        assert robot.core.anchor() is not None
    assert robot.drive(opposite, around(15.0, 5.0))[-1][1] is None


def test_a_wrong_initial_pose_is_no_order(building: BuildingMap) -> None:
    robot = Robot(building)
    robot.drive(hall(), around(30.0, 1.0))
    robot.core._localizer.add_initial(Pose2(-3.0, 9.0, 2.0), np.diag([0.25, 0.25, 0.07]))
    seen = robot.drive(hall(), around(30.0, 12.0))
    assert max(errors_m(seen)) < 0.15
    assert seen[-1][1] is not None


def test_without_a_laser_wifi_and_wheels_name_the_place_to_some_metres(building: BuildingMap) -> None:
    seen = Robot(building, laser=False).drive(hall(), around(30.0, 40.0))
    errors = errors_m(seen)
    assert len(errors) > 15
    assert max(errors) < 6.0
    assert float(np.median(errors)) < 3.0


def test_without_any_sensor_nothing_is_claimed(building: BuildingMap) -> None:
    robot = Robot(building, laser=False, wifi=False)
    assert errors_m(robot.drive(hall(), around(30.0, 10.0))) == []


def test_an_empty_map_claims_nothing() -> None:
    empty = map_of(hall(), ROUND[:1], laser=False, wifi=False)
    assert errors_m(Robot(empty).drive(hall(), around(0.0, 6.0))) == []


def test_memory_is_bounded_however_far_it_drives(building: BuildingMap) -> None:
    robot = Robot(building)
    seen = robot.drive(hall(), np.concatenate([ROUND, ROUND]))
    track = robot.core._track
    assert len(track) == 2 * len(ROUND)
    assert track.newest - track.oldest < 2 * KEPT
    assert max(errors_m(seen)) < 0.15
    assert len(robot.core._localizer.hypotheses) <= SlamConfig().localization.most_hypotheses
