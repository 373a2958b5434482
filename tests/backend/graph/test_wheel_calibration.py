"""What wheels of a calibration really made of their word, against the simulated drive that they erred on."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wayfi.backend.errors import WayfiError
from wayfi.backend.graph.wheel_calibration import NAMES, WheelCalibration, WheelMotion, chain, corrected_all
from wayfi.backend.pose2 import Floats, Pose2, wrap

MOTIONS = st.builds(
    WheelMotion,
    st.builds(Pose2, st.floats(-2, 2), st.floats(-2, 2), st.floats(-3, 3)),
    st.floats(0, 3),
    st.floats(0, 10),
)
CALIBRATIONS = st.tuples(st.floats(-0.2, 0.2), st.floats(-0.2, 0.2), st.floats(-0.1, 0.1), st.floats(-0.01, 0.01)).map(
    np.array
)


def row(motion: WheelMotion) -> Floats:
    return np.array([*motion.pose.array(), motion.path_m, motion.seconds])


@settings(deadline=None)
@given(MOTIONS)
def test_right_wheels_are_taken_at_their_word(motion: WheelMotion) -> None:
    corrected = motion.corrected(np.zeros(4))
    assert (corrected.x, corrected.y) == (motion.pose.x, motion.pose.y)
    assert abs(wrap(corrected.theta - motion.pose.theta)) < 1e-12


@settings(deadline=None)
@given(MOTIONS, CALIBRATIONS)
def test_the_correction_turns_by_the_bias_and_stretches_by_the_scale(motion: WheelMotion, c: Floats) -> None:
    corrected = motion.corrected(c)
    extra = c[1] * motion.pose.theta + c[2] * motion.path_m + c[3] * motion.seconds
    assert abs(wrap(corrected.theta - motion.pose.theta - extra)) < 1e-12
    told = math.hypot(motion.pose.x, motion.pose.y)
    assert math.isclose(math.hypot(corrected.x, corrected.y), (1 + c[0]) * told, abs_tol=1e-12)


@settings(deadline=None)
@given(st.lists(MOTIONS, min_size=1, max_size=6), CALIBRATIONS)
def test_many_motions_are_corrected_as_each_is(motions: list[WheelMotion], c: Floats) -> None:
    rows = np.array([row(motion) for motion in motions])
    singles = np.array([motion.corrected(c).array() for motion in motions])
    difference = corrected_all(rows, c) - singles
    difference[:, 2] = [wrap(angle) for angle in difference[:, 2]]
    np.testing.assert_allclose(difference, 0, atol=1e-12)


@settings(deadline=None)
@given(st.lists(MOTIONS, max_size=6), CALIBRATIONS)
def test_a_chain_joins_the_corrected_motions(motions: list[WheelMotion], c: Floats) -> None:
    poses = chain(corrected_all(np.array([row(motion) for motion in motions]).reshape(-1, 5), c))
    T = Pose2()
    for pose, motion in zip(poses[1:], motions, strict=True):
        T = T @ motion.corrected(c)
        np.testing.assert_allclose([pose[0] - T.x, pose[1] - T.y, wrap(pose[2] - T.theta)], 0, atol=1e-9)
    np.testing.assert_array_equal(poses[0], 0)


def test_a_bias_per_metre_bends_a_straight_told_line_into_the_arc_that_was_driven() -> None:
    bias, length, steps = 0.05, 20.0, 200
    told = np.tile([length / steps, 0.0, 0.0, length / steps, 0.1], (steps, 1))
    end = chain(corrected_all(told, np.array([0.0, 0.0, bias, 0.0])))[-1]
    radius = 1 / bias
    arc = [radius * math.sin(bias * length), radius * (1 - math.cos(bias * length)), bias * length]
    np.testing.assert_allclose(end, arc, atol=1e-3)


@pytest.mark.parametrize(
    ("values", "sigmas"),
    [
        (np.zeros(3), np.ones(4)),
        (np.zeros(4), np.ones(5)),
        (np.array([0.0, math.nan, 0.0, 0.0]), np.ones(4)),
        (np.zeros(4), np.array([1.0, 1.0, math.inf, 1.0])),
        (np.zeros(4), np.array([1.0, 0.0, 1.0, 1.0])),
        (np.zeros(4), np.array([1.0, -1.0, 1.0, 1.0])),
    ],
)
def test_a_calibration_that_says_nothing_is_refused(values: Floats, sigmas: Floats) -> None:
    with pytest.raises(WayfiError, match="a wheel calibration"):
        WheelCalibration(values, sigmas)


def test_the_four_numbers_have_names() -> None:
    assert len(NAMES) == len(set(NAMES)) == 4
