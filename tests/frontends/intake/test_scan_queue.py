"""Sweeps that wait for the odometry: when they are ready, where they were taken, and how long they have waited."""

import numpy as np

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.intake.scan_queue import ScanQueue
from wayfi.frontends.measurements import LaserScan
from wayfi.frontends.odometry.driven_path import DrivenPath
from wayfi.frontends.odometry.odometry_config import OdometryConfig

S = 1_000_000_000


def scan(ranges: list[float], each_s: float = 0.0) -> LaserScan:
    return LaserScan(S, "laser", np.array(ranges, np.float32), 0.0, 0.1, 0.05, 30.0, each_s)


def test_a_scan_waits_until_the_odometry_has_covered_its_sweep() -> None:
    path = DrivenPath(OdometryConfig())
    queue = ScanQueue()
    queue.add(S, scan([1.0] * 50, each_s=0.01))
    path.advance(S // 2, Pose2())
    path.advance(S + S // 4, Pose2())
    assert queue.ready(path) == []
    path.advance(S + S // 2, Pose2())
    assert len(queue.ready(path)) == 1
    assert queue.ready(path) == []


def test_a_scan_from_before_the_path_has_no_place() -> None:
    path, queue = DrivenPath(OdometryConfig()), ScanQueue()
    queue.add(S // 2, scan([1.0]))
    path.advance(S, Pose2())
    assert [point for point, _ in queue.ready(path)] == [None]


def test_scans_ahead_of_the_odometrys_clock_are_forgotten() -> None:
    queue, ahead = ScanQueue(), scan([2.0])
    queue.add(S, scan([1.0]))
    queue.add(10 * S, ahead)
    assert queue.waited_ns == S  # a gap counts for a second
    assert queue.drop_ahead(5 * S) == [ahead]
    assert [stamp_ns for stamp_ns, _ in queue.waiting()] == [S]
    assert queue.waited_ns == 0
