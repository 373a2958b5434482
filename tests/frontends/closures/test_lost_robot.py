"""A robot that was moved is found where two of its scans agree on one place, and nowhere if several places fit."""

import math

import numpy as np
import pytest
from rooms import HALL, see

from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.closures.closure_config import ClosureConfig
from wayfi.frontends.closures.lost_robot import Found, LostRobotSearch
from wayfi.frontends.keyframes import Keyframe, Keyframes
from wayfi.frontends.lidar.lidar_config import LidarConfig
from wayfi.frontends.odometry.driven_path import PathPoint
from wayfi.frontends.scan_points import ScanPoints
from wayfi.recordings.simulation.surfaces import box

NEXT_DOOR = Pose2(25.0, 3.0, 0.0)
ELSEWHERE = np.concatenate([box(40.0, 0.0, 44.0, 7.0), box(41.0, 1.0, 42.0, 1.5)])
MAPPED = [Pose2(-4.5 + 0.5 * k, -2.5, 0.0) for k in range(20)]
BACK = [Pose2(4.0 - 0.5 * k, -2.0, math.pi) for k in range(14)]
SLIPPED = Pose2(7.0, -3.0, 1.3)  # where the wheels put the robot, which errs by this


def shifted(faces: Floats, T: Pose2) -> Floats:
    """Faces (n, 4) moved by T, which does not turn."""
    return faces + np.tile([T.x, T.y], 2)


class Drive:
    """Keyframes along `ways` among `faces`: the first way is the map, the others are after the robot was moved."""

    def __init__(self, faces: Floats, *ways: list[Pose2]) -> None:
        self.keyframes = Keyframes()
        self.found: list[Found] = []
        self.truth = [pose for way in ways for pose in way]
        self.search = LostRobotSearch(self.keyframes, ClosureConfig(), LidarConfig())
        self.poses = np.empty((0, 3))
        rng = np.random.default_rng(0)
        for number, way in enumerate(ways):
            for k, pose in enumerate(way):
                self.add(pose if number == 0 else SLIPPED @ pose, see(faces, pose, rng), moved=number > 0 and k == 0)

    def add(self, estimate: Pose2, scan: ScanPoints, moved: bool = False) -> None:
        n = len(self.keyframes)
        if moved:
            self.keyframes.begin_piece(15.0)
            self.search.begin(n)
        self.keyframes.append(Keyframe(PathPoint(n, estimate, 0.5 * n), scan))
        self.poses = np.vstack([self.poses, estimate.array()])
        self.found += self.search.search(n, self.poses)

    def worst_m(self) -> float:
        """How far the found keyframes are off."""
        return max(self.truth[f.a].between(self.truth[f.b]).distance(f.fit.result.T_target_scan) for f in self.found)


def test_two_scans_that_agree_find_the_robot() -> None:
    drive = Drive(HALL, MAPPED, BACK)
    first, second = drive.found
    assert first.b >= len(MAPPED)
    path = drive.keyframes.paths_m
    assert path[second.b] - path[first.b] >= ClosureConfig().lost.confirm_m
    assert max(first.a, second.a) < len(MAPPED)
    assert drive.worst_m() < 0.03


def test_the_scan_that_tells_of_the_move_is_not_searched_for_twice(monkeypatch: pytest.MonkeyPatch) -> None:
    """Scan matching has just looked for it widely, which is as much as one message may take."""
    searched: list[int] = []
    monkeypatch.setattr(LostRobotSearch, "_compare_next", lambda _self, sweep, _poses: searched.append(sweep.b))
    Drive(HALL, MAPPED, BACK[:3])
    assert searched == [len(MAPPED) + 1] * 2


def test_nothing_is_searched_unless_the_robot_was_moved() -> None:
    assert Drive(HALL, MAPPED + BACK).found == []


def test_a_robot_beyond_the_map_is_not_found() -> None:
    inside = [Pose2(43.0, 1.0 + 0.4 * k, 1.5) for k in range(12)]
    assert Drive(np.concatenate([HALL, ELSEWHERE]), MAPPED, inside).found == []


def test_where_two_halls_are_alike_neither_is_believed() -> None:
    both = np.concatenate([HALL, shifted(HALL, NEXT_DOOR)])
    assert Drive(both, MAPPED + [NEXT_DOOR @ pose for pose in MAPPED], BACK).found == []


def test_one_scan_alone_confirms_nothing() -> None:
    elsewhere = [Pose2(43.0, 1.0 + 0.4 * k, 1.5) for k in range(12)]
    seen_once = [BACK[0], *elsewhere]
    assert Drive(np.concatenate([HALL, ELSEWHERE]), MAPPED, seen_once).found == []


def test_a_robot_that_is_moved_twice_is_found_in_the_map_of_before_the_first_time() -> None:
    inside = [Pose2(43.0, 1.0 + 0.4 * k, 1.5) for k in range(3)]
    drive = Drive(np.concatenate([HALL, ELSEWHERE]), MAPPED, inside, BACK)
    assert [f.b >= len(MAPPED) + 3 for f in drive.found] == [True, True]
    assert drive.worst_m() < 0.03


@pytest.mark.parametrize(("a", "ends"), [(3, True), (len(MAPPED) + 1, False)])
def test_a_closure_into_the_map_ends_the_search(a: int, ends: bool) -> None:
    drive = Drive(HALL, MAPPED, BACK[:2])
    drive.search.closed(a, len(MAPPED) + 1)
    rng = np.random.default_rng(1)
    for pose in BACK[2:]:
        drive.truth.append(pose)
        drive.add(SLIPPED @ pose, see(HALL, pose, rng))
    assert (drive.found == []) == ends


def test_scans_that_are_forgotten_end_the_search_of_them() -> None:
    """The laser's clock proves wrong, or its mount, while a scan is being compared with the map, or has fitted it."""
    for searched in (3, len(BACK) - 1):
        drive = Drive(HALL, MAPPED, BACK[:searched])
        scan = drive.keyframes[len(MAPPED) + 2].scan
        assert scan is not None
        drive.keyframes.forget_scans()
        drive.search.scans_forgotten()
        drive.found.clear()
        for k in range(3):
            drive.add(Pose2(0.5 * k), scan, moved=k == 1)
        assert drive.found == []


def test_the_map_that_a_drive_goes_on_with_is_searched_on_when_its_own_scans_are_forgotten() -> None:
    drive = Drive(HALL, MAPPED)
    drive.keyframes.first = len(MAPPED)
    drive.truth += BACK
    rng = np.random.default_rng(1)
    for k, pose in enumerate(BACK[:3]):
        drive.add(SLIPPED @ pose, see(HALL, pose, rng), moved=k == 0)
    drive.keyframes.forget_scans()
    drive.search.scans_forgotten()
    for pose in BACK[3:]:
        drive.add(SLIPPED @ pose, see(HALL, pose, rng))
    assert drive.worst_m() < 0.03
    assert len(drive.found) == 2
