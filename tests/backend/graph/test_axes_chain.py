"""The building's axes in the graph: they hold the heading and show the wheels' bias, wing by wing."""

import math
import pickle
from dataclasses import replace

import numpy as np
import pytest
from graphs import PRIOR, WHEELS

from wayfi.backend.graph.backend_config import BackendConfig
from wayfi.backend.graph.factors import AxisFactor, FactorError, WheelFactor
from wayfi.backend.graph.pose_graph import PoseGraph
from wayfi.backend.graph.wheel_calibration import WheelMotion
from wayfi.backend.pose2 import Pose2

BIAS = 0.02
STEP_M, STEPS = 0.5, 240
SIGMA_RAD = 0.1


def corridor(turned: dict[int, float]) -> PoseGraph:
    """120 m by wheels that turn BIAS rad/m to the right, `turned` by some angle at some steps."""
    graph = PoseGraph(BackendConfig(), PRIOR)
    graph.add_keyframe(Pose2())
    for k in range(STEPS):
        motion = WheelMotion(Pose2(STEP_M, 0.0, turned.get(k, 0.0) - BIAS * STEP_M), STEP_M, 1.0)
        graph.add_keyframe(graph.pose(k) @ motion.pose)
        graph.add(WheelFactor(k, k + 1, motion, WHEELS))
        graph.update()
    return graph


def add_axes(graph: PoseGraph, first: int, last: int, wing: int, turned: float = 0.0) -> None:
    for k in range(first, last, 4):
        graph.add(AxisFactor(k, wing, turned, SIGMA_RAD))
    graph.settle()


def test_a_corridor_is_straight_and_shows_the_wheels_bias() -> None:
    graph = corridor({})
    add_axes(graph, 4, STEPS, wing=1)
    assert graph.calibration_values()[2] == pytest.approx(BIAS, abs=0.001)
    assert np.abs(graph.poses()[:, 2]).max() < 0.05
    assert graph.poses()[-1, 1] == pytest.approx(0.0, abs=2.0)


def test_a_wing_at_an_angle_has_a_direction_of_its_own() -> None:
    graph = corridor({STEPS // 2: 0.6})
    add_axes(graph, 4, STEPS // 2, wing=1)
    add_axes(graph, STEPS // 2 + 4, STEPS, wing=2)
    assert graph.calibration_values()[2] == pytest.approx(BIAS, abs=0.001)
    assert graph.poses()[-1, 2] == pytest.approx(0.6, abs=0.05)


def test_a_wing_that_the_robot_comes_back_to_has_the_direction_it_had() -> None:
    """The wheels miss 0.1 rad of the turn back, which only the first wing's direction tells."""
    graph = corridor({STEPS // 3: 0.6, 2 * STEPS // 3: -0.5})
    add_axes(graph, 4, STEPS // 3, wing=1)
    add_axes(graph, STEPS // 3 + 4, 2 * STEPS // 3, wing=2)
    add_axes(graph, 2 * STEPS // 3 + 4, STEPS, wing=1)
    assert graph.poses()[-1, 2] == pytest.approx(0.0, abs=0.05)
    graph.restart(graph.calibrations(), graph.poses())
    graph.settle()
    assert graph.poses()[-1, 2] == pytest.approx(0.0, abs=0.05)


def test_a_quarter_turn_stays_one() -> None:
    graph = corridor({STEPS // 2: math.pi / 2 - 0.05})
    add_axes(graph, 4, STEPS // 2, wing=1)
    add_axes(graph, STEPS // 2 + 4, STEPS, wing=1, turned=math.pi / 2)
    assert graph.poses()[-1, 2] == pytest.approx(math.pi / 2, abs=0.03)


def test_rounds_are_no_turn_of_the_axes() -> None:
    """After a whole turn headings come again, while the turns from the axes go on counting."""
    corners = dict.fromkeys(range(39, STEPS, 40), math.pi / 2)
    graph = corridor(corners)
    for k in range(4, STEPS, 4):
        graph.add(AxisFactor(k, 1, (k // 40) * math.pi / 2, SIGMA_RAD))
        graph.update()
    graph.settle()
    graph.restart(graph.calibrations(), graph.poses())
    graph.update()
    assert graph.calibration_values()[2] == pytest.approx(BIAS, abs=0.001)
    assert graph.poses()[160, :2] == pytest.approx((0.0, 0.0), abs=1.0)


def test_the_axes_survive_a_checkpoint_and_a_restart() -> None:
    graph = corridor({})
    add_axes(graph, 4, STEPS, wing=1)
    restored = pickle.loads(pickle.dumps(graph))
    np.testing.assert_allclose(restored.poses(), graph.poses(), atol=0.05)
    graph.restart(graph.calibrations(), np.zeros((STEPS + 1, 3)) + graph.poses())
    graph.settle()
    assert np.abs(graph.poses()[:, 2]).max() < 0.05
    assert len(graph.of_kind(AxisFactor)) == len(range(4, STEPS, 4))


@pytest.mark.parametrize(
    "factor", [AxisFactor(9999, 1, 0.0, 0.1), AxisFactor(1, 1, math.nan, 0.1), AxisFactor(1, 1, 0.0, 0.0)]
)
def test_one_that_would_poison_the_graph_is_refused(factor: AxisFactor) -> None:
    graph = corridor({})
    with pytest.raises(FactorError):
        graph.add(factor)


def test_wheels_that_slipped_turn_where_they_are_doubted() -> None:
    graph = corridor({STEPS // 2: 0.35})
    add_axes(graph, 4, STEPS, wing=1)
    for number, factor in graph.factors().items():
        if isinstance(factor, WheelFactor) and factor.a == STEPS // 2:
            graph.substitute(number, replace(factor, covariance=factor.covariance + np.diag([0.0, 0.0, 0.1])))
    graph.settle()
    assert np.abs(graph.poses()[:, 2]).max() < 0.05
    assert [wheels.a for wheels in graph.of_kind(WheelFactor)] == list(range(STEPS))


def test_a_factor_that_changes_during_a_rebuild_is_not_lost() -> None:
    graph = corridor({STEPS // 2: 0.35})
    add_axes(graph, 4, STEPS, wing=1)
    graph.restart(graph.calibrations(), graph.poses())
    graph.update(work=1)
    assert graph.restarts
    for number, factor in graph.factors().items():
        if isinstance(factor, WheelFactor) and factor.a == STEPS // 2:
            graph.substitute(number, replace(factor, covariance=factor.covariance + np.diag([0.0, 0.0, 0.1])))
    graph.settle()
    assert np.abs(graph.poses()[:, 2]).max() < 0.05
