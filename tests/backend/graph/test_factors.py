"""What would make the graph unsolvable is refused, and leaves it as it was."""

import math

import numpy as np
import pytest
from graphs import ARC, STEP, chain

from wayfi.backend.graph.factors import BetweenFactor, Factor, FactorError, NearFactor, WheelFactor
from wayfi.backend.graph.wheel_calibration import WheelMotion
from wayfi.backend.pose2 import Pose2

BAD_COVARIANCES = {
    "asymmetric": np.array([[1.0, 0.5, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]),
    "symmetric 3 x 3": np.eye(2),
    "positive definite": np.diag([1.0, -1.0, 1.0]),
    "definite": np.diag([1.0, 1.0, 0.0]),
    "finite": np.diag([1.0, math.nan, 1.0]),
    "must be finite": np.diag([1.0, math.inf, 1.0]),
}
MOTION = WheelMotion(Pose2(0.5, 0.0, 0.1), 0.5, 1.0)
BAD_FACTORS: dict[str, Factor] = {
    "x is NaN": BetweenFactor(0, 5, Pose2(math.nan, 0.0, 0.0), STEP),
    "theta is infinite": BetweenFactor(0, 5, Pose2(0.0, 0.0, math.inf), STEP),
    "no such keyframe": BetweenFactor(0, 11, Pose2(), STEP),
    "a negative keyframe": BetweenFactor(-1, 5, Pose2(), STEP),
    "a keyframe with itself": BetweenFactor(5, 5, Pose2(), STEP),
    "wheels without a pose": WheelFactor(0, 1, WheelMotion(Pose2(math.nan, 0.0, 0.0), 0.5, 1.0), STEP),
    "wheels without a path": WheelFactor(0, 1, WheelMotion(Pose2(), math.nan, 1.0), STEP),
    "wheels without a time": WheelFactor(0, 1, WheelMotion(Pose2(), 0.5, math.inf), STEP),
    "wheels to nowhere": WheelFactor(10, 11, MOTION, STEP),
    "a place that is NaN": NearFactor(0, 5, np.array([math.nan, 0.0]), np.zeros(2), 1.0),
    "a place to no keyframe": NearFactor(0, 11, np.zeros(2), np.zeros(2), 1.0),
    "a place known to nothing": NearFactor(0, 5, np.zeros(2), np.zeros(2), 0.0),
    "a place known to infinity": NearFactor(0, 5, np.zeros(2), np.zeros(2), math.inf),
} | {f"covariance not {name}": BetweenFactor(0, 5, Pose2(), bad) for name, bad in BAD_COVARIANCES.items()}


@pytest.mark.parametrize("factor", BAD_FACTORS.values(), ids=BAD_FACTORS.keys())
def test_a_factor_that_would_poison_the_graph_is_refused_and_leaves_it_as_it_was(factor: Factor) -> None:
    graph = chain(ARC)
    before, factors = graph.poses(), graph.factors()
    with pytest.raises(FactorError, match=rf"{type(factor).__name__} {factor.a} -> {factor.b}: "):
        graph.add(factor)
    assert graph.factors() == factors
    assert graph.update().added == 0
    np.testing.assert_array_equal(graph.poses(), before)
    good = graph.pose(0).between(graph.pose(10))
    graph.add(BetweenFactor(0, 10, good, STEP))
    graph.update()
    np.testing.assert_allclose(graph.poses(), before, atol=1e-9)


@pytest.mark.parametrize("guess", [Pose2(math.nan, 0, 0), Pose2(0, math.inf, 0), Pose2(0, 0, math.nan)], ids=str)
def test_a_keyframe_without_a_finite_guess_is_refused(guess: Pose2) -> None:
    graph = chain(ARC)
    with pytest.raises(FactorError, match="first guess of keyframe 11 is not finite"):
        graph.add_keyframe(guess)
    assert graph.keyframes == 11
    assert graph.update().factors == 10


def test_what_is_not_in_the_graph_cannot_be_removed() -> None:
    with pytest.raises(FactorError, match="no factor 99"):
        chain(ARC).remove(99)
