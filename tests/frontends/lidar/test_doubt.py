"""Doubt begins with steps that disagree, gets worse with more of them, and ends with steps that agree."""

import numpy as np
import pytest

from wayfi.backend.graph.health import State
from wayfi.backend.graph.wheel_calibration import WheelMotion
from wayfi.backend.pose2 import Pose2
from wayfi.frontends.lidar.doubt import AGREES, SILENT, UNFIT, Doubt, DoubtConfig, StepJudged, misfit, misses, slipped

CONFIG = DoubtConfig()
ROLLED = WheelMotion(Pose2(0.5, 0.0, 0.1), 0.5, 1.0)
STOOD = WheelMotion(Pose2(), 0.0, 1.0)
CARRIED = misfit(STOOD, CONFIG)


def slip(motion: WheelMotion = ROLLED, T: Pose2 | None = None) -> StepJudged:
    return slipped(motion, motion.pose, T or Pose2(0.1, 0.0, 0.1))


def after(*steps: StepJudged) -> Doubt:
    doubt = Doubt(CONFIG)
    for step in steps:
        doubt.add(step)
    return doubt


def state(doubt: Doubt) -> State | None:
    return doubt.health.state if doubt.health else None


@pytest.mark.parametrize(
    ("steps", "expected"),
    [
        ([], None),
        ([AGREES, AGREES], None),
        ([slip(), slip(), AGREES, slip()], None),
        ([slip(), SILENT, slip(), slip()], State.UNCERTAIN),
        ([UNFIT, UNFIT], None),
        ([UNFIT, UNFIT, UNFIT, UNFIT], State.UNCERTAIN),
        ([AGREES, CARRIED], State.UNCERTAIN),
        ([CARRIED, CARRIED, CARRIED], State.LOST),
        ([CARRIED, CARRIED, CARRIED, AGREES, AGREES], State.LOST),
        ([CARRIED, CARRIED, CARRIED, AGREES, AGREES, AGREES], None),
        ([CARRIED, AGREES, AGREES, CARRIED, AGREES], State.UNCERTAIN),
    ],
)
def test_the_state_follows_what_scans_say_in_a_row(steps: list[StepJudged], expected: State | None) -> None:
    assert state(after(*steps)) is expected


@pytest.mark.parametrize(
    ("motion", "T", "says"),
    [
        (STOOD, Pose2(0.3, 0.0, 0.0), "the laser moves while the wheels stand still"),
        (ROLLED, Pose2(), "the wheels turn while the laser stands still"),
        (ROLLED, Pose2(-0.5, 0.0, 0.0), "the wheels go the other way than the laser"),
        (ROLLED, Pose2(0.2, 0.0, 0.1), "the wheels contradict the laser"),
    ],
)
def test_the_reason_names_what_disagrees(motion: WheelMotion, T: Pose2, says: str) -> None:
    health = after(*[slip(motion, T)] * CONFIG.slips).health
    assert health is not None
    assert health.reason.startswith(says)


def test_scans_that_fit_nowhere_are_counted_in_the_reason() -> None:
    health = after(*[CARRIED] * 3).health
    assert health is not None
    assert health.reason.startswith("3 scans in a row do not fit the map here")


def test_a_slip_is_covered_by_what_it_adds_unless_it_is_alone() -> None:
    doubt, T = Doubt(CONFIG), Pose2(0.1, 0.2, -0.3)
    assert not doubt.add(slip(ROLLED, T)).any()
    grown = doubt.add(slip(ROLLED, T)) + 1e-9 * np.eye(3)
    e = T.array() - ROLLED.pose.array()
    assert e @ np.linalg.solve(grown, e) < 1.0
    assert Doubt(CONFIG).add(slip(STOOD, T)).any()


def test_a_robot_that_fits_nowhere_may_be_as_far_as_people_carry_it() -> None:
    short, long = misfit(STOOD, CONFIG), misfit(WheelMotion(Pose2(), 0.0, 5.0), CONFIG)
    assert np.sqrt(short.covariance[0, 0]) == pytest.approx(2.0)
    assert np.sqrt(long.covariance[0, 0]) == pytest.approx(6.0)


def test_a_leap_is_doubted_where_scans_can_tell_and_nowhere_else() -> None:
    blind, seeing = Doubt(CONFIG), after(AGREES, AGREES)
    blind.leapt(3.2)
    seeing.leapt(3.2)
    assert blind.health is None
    assert seeing.health is not None
    assert seeing.health.reason == "the odometry leapt 3.2 m"
    seeing.add(AGREES)
    assert state(seeing) is State.UNCERTAIN


@pytest.mark.parametrize(
    ("motion", "e", "gross"),
    [
        (STOOD, [0.1, 0.0, 0.0], True),
        (ROLLED, [0.1, 0.0, 0.0], False),
        (ROLLED, [-0.5, 0.0, 0.0], True),
        (WheelMotion(Pose2(0.0, 0.0, 0.5), 0.0, 1.0), [0.0, 0.1, 0.0], False),
        (WheelMotion(Pose2(0.0, 0.0, 0.5), 0.0, 1.0), [0.0, 0.0, -1.0], True),
    ],
)
def test_wheels_that_miss_most_of_a_motion_have_failed(motion: WheelMotion, e: list[float], gross: bool) -> None:
    assert misses(motion, np.array(e)) is gross
