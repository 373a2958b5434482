"""What odometry says of a motion that is known."""

import math

import pytest

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.measurements import SECOND_NS, Odometry
from wayfi.recordings.inspecting.motion import Motion


def at(second: float, x: float, theta: float = 0.0, speed: float = 0.0, frame: str = "base_link") -> Odometry:
    return Odometry(round(second * SECOND_NS), Pose2(x, 0.0, theta), child_frame_id=frame, twist=(speed, 0.0, 0.0))


def test_a_drive_a_stop_and_a_turn_are_measured() -> None:
    motion = Motion()
    for step in range(301):
        seconds = step / 10
        x = min(seconds, 10.0) * 0.5
        theta = max(seconds - 20.0, 0.0) * 0.4
        motion.add(at(seconds, x, math.remainder(theta, 2 * math.pi), 0.5 if seconds < 10 else 0.0))
    found = motion.inspection()
    assert found.path_m == pytest.approx(5.0)
    assert found.top_speed_m_s == pytest.approx(0.5)
    assert found.top_turn_rad_s == pytest.approx(0.4)
    assert found.longest_still_s == pytest.approx(10.0, abs=0.2)
    assert found.twist_path_m == pytest.approx(5.0, abs=0.1)
    assert found.child_frames == {"base_link": 301}


def test_poses_that_are_none_and_another_source_change_nothing() -> None:
    motion = Motion()
    for step in range(100):
        motion.add(at(step / 10, step / 10))
        motion.add(at(step / 10, -step, frame="/other") if step % 2 else at(step / 10, math.nan))
    motion.add(at(10.0, 1e200))
    found = motion.inspection()
    assert found.path_m == pytest.approx(9.9)
    assert found.child_frames == {"base_link": 151, "other": 50}
    assert Motion().inspection().path_m == 0.0
