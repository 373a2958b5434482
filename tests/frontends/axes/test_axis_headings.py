"""Headings along the axes of a building enter the graph where no scan match tells them, and nowhere else."""

import numpy as np
import pytest
from graphs import PRIOR, WHEELS

from wayfi.backend.graph.backend_config import BackendConfig
from wayfi.backend.graph.factors import AxisFactor, BetweenFactor, WheelFactor
from wayfi.backend.graph.pose_graph import PoseGraph
from wayfi.backend.graph.wheel_calibration import WheelMotion
from wayfi.backend.pose2 import Pose2
from wayfi.frontends.axes.axis_headings import AxisHeadings, withdraw_axes
from wayfi.frontends.odometry.odometry_config import AxesConfig

BIAS, STEP_M = 0.025, 0.5


def driven(config: AxesConfig, steps: int, matched_every: int = 0, slip_at: int = -1) -> PoseGraph:
    """The graph after a straight drive by wheels that turn BIAS rad/m to the right, scans matching now and then."""
    graph = PoseGraph(BackendConfig(), PRIOR)
    axes = AxisHeadings(graph, PRIOR, config)
    graph.add_keyframe(Pose2())
    for k in range(steps):
        slip = 0.35 if k == slip_at else 0.0
        motion = WheelMotion(Pose2(STEP_M, 0.0, slip - BIAS * STEP_M), STEP_M, 1.0)
        poses = graph.poses() if k else np.zeros((1, 3))
        graph.add_keyframe(Pose2.of(poses[-1]) @ motion.pose)
        graph.add(WheelFactor(k, k + 1, motion, WHEELS))
        if matched_every and k % matched_every == 0:
            axes.interrupt()
        else:
            axes.follow(k + 1, motion, float(WHEELS[2, 2]), poses)
        graph.update()
    return graph


def test_a_straight_drive_is_straightened_within_fifty_metres() -> None:
    graph = driven(AxesConfig(enabled=True), 100)
    assert graph.calibration_values()[2] == pytest.approx(BIAS, abs=0.005)
    assert abs(graph.poses()[-1, 2]) < 0.15
    assert len(graph.of_kind(AxisFactor)) > 10


def test_what_scans_tell_is_left_to_them() -> None:
    assert driven(AxesConfig(enabled=True), 100, matched_every=10).of_kind(AxisFactor) == []


def test_it_can_be_switched_off() -> None:
    graph = driven(AxesConfig(enabled=False), 100)
    assert graph.of_kind(AxisFactor) == []
    assert abs(graph.poses()[-1, 2]) > 1.0


def test_a_slip_is_undone_where_the_axes_go_on() -> None:
    """The step of the slip may turn; the wheels elsewhere keep their covariance, and the corridor is one line."""
    graph = driven(AxesConfig(enabled=True), 160, slip_at=100)
    doubted = [wheels.a for wheels in graph.of_kind(WheelFactor) if wheels.covariance[2, 2] > 2 * WHEELS[2, 2]]
    assert 100 in doubted
    assert len(doubted) < 20
    assert [wheels.a for wheels in graph.of_kind(WheelFactor)] == list(range(160))


def test_wings_are_numbered_on_from_those_of_a_map() -> None:
    graph = PoseGraph(BackendConfig(), PRIOR)
    graph.add_keyframe(Pose2())
    graph.add(AxisFactor(0, 3, 0.0, 0.05))
    axes = AxisHeadings(graph, PRIOR, AxesConfig(enabled=True))
    for k in range(100):
        motion = WheelMotion(Pose2(STEP_M, 0.0, -BIAS * STEP_M), STEP_M, 1.0)
        poses = graph.poses() if k else np.zeros((1, 3))
        graph.add_keyframe(Pose2.of(poses[-1]) @ motion.pose)
        graph.add(WheelFactor(k, k + 1, motion, WHEELS))
        axes.follow(k + 1, motion, float(WHEELS[2, 2]), poses)
        graph.update()
    own = {factor.wing for factor in graph.of_kind(AxisFactor) if factor.b > 0}
    assert own
    assert min(own) > 3


def test_at_the_end_axes_that_were_withdrawn_are_found_again_for_all_of_the_drive() -> None:
    graph = driven(AxesConfig(enabled=True), 160, slip_at=60)
    withdraw_axes(graph)
    graph.settle()
    assert abs(graph.poses()[-1, 2]) > 1.0
    axes = AxisHeadings(graph, PRIOR, AxesConfig(enabled=True))
    assert axes.decide_again()
    graph.settle()
    assert np.quantile(np.abs(graph.poses()[:, 2]), 0.9) < 0.1, "but for the sample in which the wheels slipped"
    assert min(factor.b for factor in graph.of_kind(AxisFactor)) < 20
    assert not axes.decide_again(), "the same wheels tell the same axes"


def test_at_the_end_nothing_is_decided_again_that_scans_tell_or_that_is_switched_off() -> None:
    graph = driven(AxesConfig(enabled=True), 100)
    withdraw_axes(graph)
    assert not AxisHeadings(graph, PRIOR, AxesConfig(enabled=False)).decide_again()
    graph.add(BetweenFactor(50, 51, Pose2(STEP_M, 0.0, 0.0), np.diag([1e-4, 1e-4, 1e-6])))
    graph.settle()
    assert not AxisHeadings(graph, PRIOR, AxesConfig(enabled=True)).decide_again()
    assert graph.of_kind(AxisFactor) == []


@pytest.mark.parametrize(("missed", "quarters"), [(0.08, 0), (-0.08, 1), (0.05, -1), (0.3, 0)])
def test_at_the_end_a_wing_of_the_first_ones_direction_is_that_one(missed: float, quarters: int) -> None:
    """There and back into a wing at 0.6 rad, by wheels that miss some of the turn back, and name another axis."""
    graph, rad = PoseGraph(BackendConfig(), PRIOR), quarters * np.pi / 2
    graph.add_keyframe(Pose2())
    for k in range(150):
        turn = {50: 0.6, 100: missed - 0.6}.get(k, 0.0)
        motion = WheelMotion(Pose2(STEP_M, 0.0, turn), STEP_M, 1.0)
        graph.add_keyframe(graph.pose(k) @ motion.pose)
        graph.add(WheelFactor(k, k + 1, motion, WHEELS + np.diag([0.0, 0.0, 0.01 * (k == 100)])))
    for k in range(4, 150, 4):
        wing = 1 + (k > 50) + (k > 100)
        graph.add(AxisFactor(k, wing, rad if wing == 3 else 0.0, 0.1))
    graph.settle()
    assert AxisHeadings(graph, PRIOR, AxesConfig()).join_wings() == (missed < 0.1)
    graph.settle()
    assert graph.poses()[-1, 2] == pytest.approx(0.0 if missed < 0.1 else missed, abs=0.03)
    assert {f.wing for f in graph.of_kind(AxisFactor)} == ({1, 2} if missed < 0.1 else {1, 2, 3})


def test_what_scans_have_mapped_stays_where_the_laser_is_blind_afterwards() -> None:
    """Four rounds that scans closed; then 100 m of wheels alone, whose axes bend what was driven by them."""
    rng, side, rounds = np.random.default_rng(1), 40, 4
    graph, truth, bias = PoseGraph(BackendConfig(), PRIOR), [Pose2()], 0.0
    axes = AxisHeadings(graph, PRIOR, AxesConfig(enabled=True))
    graph.add_keyframe(Pose2())
    for k in range(1, rounds * 4 * side):
        step = Pose2(STEP_M, 0.0, 0.0 if k % side else np.pi / 2)
        truth.append(truth[-1] @ step)
        bias += rng.normal(0.0, 0.0012)
        graph.add_keyframe(graph.pose(k - 1) @ step)
        graph.add(
            WheelFactor(k - 1, k, WheelMotion(Pose2(STEP_M, 0.0, step.theta - bias * STEP_M), STEP_M, 1.0), WHEELS)
        )
        graph.add(BetweenFactor(k - 1, k, step, WHEELS / 25))
        if k >= 4 * side and k % 20 == 0:
            graph.add(BetweenFactor(k - 4 * side, k, truth[k - 4 * side].between(truth[k]), WHEELS / 25))
        graph.update()
    mapped = len(truth)
    for k in range(mapped, mapped + 200):
        motion, poses = WheelMotion(Pose2(STEP_M, 0.0, -(bias + 0.03) * STEP_M), STEP_M, 1.0), graph.poses()
        graph.add_keyframe(Pose2.of(poses[-1]) @ motion.corrected(graph.calibration_values()))
        graph.add(WheelFactor(k - 1, k, motion, WHEELS))
        axes.follow(k, motion, float(WHEELS[2, 2]), poses)
        graph.update()
    graph.settle()
    assert graph.of_kind(AxisFactor)
    assert max(graph.pose(k).distance(T) for k, T in enumerate(truth)) < 0.2
