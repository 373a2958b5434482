"""Poses from outside before they are used: what is refused and why, and where on the path the others lie."""

from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.events import Dropped, DropReason, Event, Warned
from wayfi.frontends.frames.frames_config import FramesConfig
from wayfi.frontends.intake.pose_intake import MOST_WAITING, PlacedPose, PoseIntake
from wayfi.frontends.measurements import InitialPose, OutsidePose, PoseFix, Sensor
from wayfi.frontends.odometry.driven_path import DrivenPath
from wayfi.frontends.odometry.odometry_config import ClockConfig, OdometryConfig
from wayfi.frontends.odometry.timebase import TimeBase

S = 1_000_000_000
SPEED_M_S = 0.5
PLACE = Pose2(3.0, 4.0, 0.5)
COVARIANCE = np.diag([0.04, 0.04, 0.01])


def fix(stamp_s: float = 0.0) -> PoseFix:
    return PoseFix(round(stamp_s * S), PLACE, COVARIANCE)


def initial(stamp_s: float = 0.0) -> InitialPose:
    return InitialPose(round(stamp_s * S), PLACE, COVARIANCE)


@dataclass
class Drive:
    """A robot that drives straight on, and what its intake gives and says."""

    path: DrivenPath = field(default_factory=lambda: DrivenPath(OdometryConfig()))
    time: TimeBase = field(default_factory=lambda: TimeBase(ClockConfig()))
    frames: FramesConfig = field(default_factory=FramesConfig)
    placed: list[PlacedPose] = field(default_factory=list)
    events: list[Event] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.intake = PoseIntake(self.frames, self.time)

    def odometry(self, *seconds: float) -> None:
        for second in seconds:
            stamped = self.time.accept(round(second * S))
            self.path.advance(stamped.stamp_ns, Pose2(SPEED_M_S * second, 0.0, 0.0))
            self._sort()

    def hear(self, *poses: OutsidePose) -> None:
        for pose in poses:
            self.events += self.intake.add(pose, self.path.latest)
            self._sort()

    def _sort(self) -> None:
        for each in self.intake.ready(self.path):
            (self.placed if isinstance(each, PlacedPose) else self.events).append(each)  # type: ignore[arg-type]

    def dropped(self) -> list[DropReason]:
        return [event.reason for event in self.events if isinstance(event, Dropped)]

    def told(self) -> list[str]:
        return [event.text for event in self.events if isinstance(event, Warned)]

    def seconds(self) -> list[float]:
        return [placed.point.stamp_ns / S for placed in self.placed]


def driving(frames: FramesConfig | None = None) -> Drive:
    drive = Drive(frames=frames or FramesConfig())
    drive.odometry(100.0, 101.0, 102.0)
    return drive


def test_a_fix_lies_where_the_path_was_at_its_stamp() -> None:
    drive = driving()
    drive.hear(fix(101.5))
    (placed,) = drive.placed
    assert placed.sensor is Sensor.FIX
    assert placed.point.stamp_ns == 101.5 * S
    assert placed.point.T_path_base.x == pytest.approx(101.5 * SPEED_M_S)
    assert (placed.T_map_base, placed.covariance) == (PLACE, COVARIANCE)
    assert not drive.events


def test_a_fix_ahead_waits_for_the_odometry_and_others_do_not_wait_for_it() -> None:
    drive = driving()
    drive.hear(fix(103.5), fix(101.0))
    assert drive.seconds() == [101.0]
    drive.odometry(103.0, 104.0)
    assert drive.seconds() == [101.0, 103.5]


def test_a_fix_that_no_odometry_will_cover_is_dropped() -> None:
    drive = driving()
    drive.hear(fix(110.0), fix(12.0))
    assert drive.dropped() == [DropReason.AHEAD, DropReason.TOO_LATE]
    drive.hear(fix(104.0))
    drive.events += drive.intake.finish()
    assert drive.dropped()[2:] == [DropReason.AHEAD]
    assert not drive.placed


@pytest.mark.parametrize("pose", [fix(), initial(), initial(5.0), initial(4000.0)])
def test_a_stamp_of_zero_means_now_and_so_does_an_initial_pose_off_the_path(pose: OutsidePose) -> None:
    drive = driving()
    drive.hear(pose)
    assert drive.seconds() == [102.0]


def test_an_initial_pose_lies_where_the_robot_was_when_it_was_given() -> None:
    drive = driving()
    drive.hear(initial(101.0))
    assert drive.seconds() == [101.0]


def test_poses_before_the_odometry_wait_for_it() -> None:
    drive = Drive()
    drive.hear(initial(), fix(100.5))
    assert not drive.placed
    drive.odometry(100.0, 101.0)
    assert drive.seconds() == [100.0, 100.5]


def test_stamps_follow_a_clock_that_was_set_back() -> None:
    drive = driving()
    drive.odometry(*(50.0 + 0.1 * k for k in range(10)))
    assert drive.time.offset_ns > 0
    latest = drive.path.latest
    assert latest
    drive.hear(fix(50.9))
    assert drive.placed[-1].point.stamp_ns == latest.stamp_ns


def test_waiting_poses_are_bounded() -> None:
    drive = Drive()
    drive.hear(*(fix(100.0 + k) for k in range(MOST_WAITING + 3)))
    assert drive.dropped() == [DropReason.TOO_MANY_WAIT] * 3


NOT_DEFINITE = np.array([[1.0, 2.0, 0.0], [2.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
REFUSED = [
    (replace(fix(), frame_id="odom"), DropReason.OTHER_FRAME, "frame is 'odom', not 'map'"),
    (replace(fix(), frame_id=""), DropReason.OTHER_FRAME, "frame is '', not 'map'"),
    (replace(fix(), T_map_base=Pose2(np.nan, 0.0, 0.0)), DropReason.NON_FINITE, "not finite"),
    (replace(fix(), T_map_base=Pose2(0.0, 0.0, np.nan)), DropReason.NON_FINITE, "quaternion of zeros"),
    (replace(fix(), T_map_base=Pose2(1e9, 0.0, 0.0)), DropReason.IMPLAUSIBLE_MOTION, "send m"),
    (replace(fix(), covariance=np.full((3, 3), np.nan)), DropReason.NON_FINITE, "not finite"),
    (replace(fix(), covariance=NOT_DEFINITE), DropReason.ABSURD_COVARIANCE, "not positive definite"),
    (replace(fix(), covariance=np.diag([1.0, 1.0, 0.0])), DropReason.ABSURD_COVARIANCE, "not positive definite"),
    (replace(fix(), covariance=np.diag([1.0, 1e300, 1.0])), DropReason.ABSURD_COVARIANCE, "not positive definite"),
    (replace(fix(), covariance=COVARIANCE + np.triu(np.ones((3, 3)), 1)), DropReason.ABSURD_COVARIANCE, "not positive"),
]


@pytest.mark.parametrize(("pose", "reason", "told"), REFUSED)
@pytest.mark.parametrize("kind", [PoseFix, InitialPose])
def test_what_is_refused_is_told_once_with_its_reason(
    kind: type[OutsidePose], pose: PoseFix, reason: DropReason, told: str
) -> None:
    drive = driving()
    refused = kind(pose.stamp_ns, pose.T_map_base, pose.covariance, pose.frame_id)
    drive.hear(refused, refused)
    assert drive.dropped() == [reason, reason]
    (text,) = drive.told()
    assert told in text
    assert text.startswith("a fix" if kind is PoseFix else "an initial pose")
    assert not drive.placed


def test_the_frame_is_the_configured_one() -> None:
    drive = driving(FramesConfig(map="hall/map"))
    drive.hear(fix(), replace(fix(), frame_id="/hall/map"))
    assert drive.dropped() == [DropReason.OTHER_FRAME]
    assert len(drive.placed) == 1


def test_an_unknown_covariance_stays_unknown() -> None:
    drive = driving()
    drive.hear(replace(fix(), covariance=None))
    assert drive.placed[0].covariance is None
