"""Closures far off, and a restart from elsewhere: the graph is optimised as a whole, and goes on from there."""

import math
import pickle

import numpy as np
from graphs import ARC, CLOSURE, PRIOR, STEP, chain, drive, errors_m, loops

from wayfi.backend.graph.backend_config import BackendConfig
from wayfi.backend.graph.factors import BetweenFactor
from wayfi.backend.graph.pose_graph import PoseGraph
from wayfi.backend.pose2 import Pose2, between_all


def test_a_closure_far_off_is_optimised_anew_and_converges() -> None:
    recorded = loops(np.array([0.0, 0.0, 0.03, 0.0]), 1)
    graph = PoseGraph(BackendConfig(), PRIOR)
    drive(graph, recorded, {})
    assert errors_m(graph, recorded.truth)[-1] > 2.0
    for a in (0, 1):
        graph.add(BetweenFactor(a, 80 - a, recorded.truth[a].between(recorded.truth[80 - a]), CLOSURE))
    graph.update(work=math.inf)
    assert errors_m(graph, recorded.truth).max() < 0.3
    assert abs(graph.calibration().values[2] - 0.03) < 0.01


def test_a_closure_far_off_converges_where_no_wheels_are() -> None:
    bent = [Pose2(1.0, 0.0, 2 * math.pi / 60 + 0.02)] * 60
    graph = chain(bent)
    assert math.hypot(graph.pose(60).x, graph.pose(60).y) > 5.0
    graph.add(BetweenFactor(0, 60, Pose2(), CLOSURE * 0.01))
    graph.update(work=math.inf)
    end = graph.pose(60)
    assert math.hypot(end.x, end.y) < 0.05
    assert abs(end.theta) < 0.02
    steps = np.diff(graph.poses()[:, :2], axis=0)
    np.testing.assert_allclose(np.hypot(*steps.T), 1.0, atol=0.02)


def test_restarting_at_the_solution_keeps_it_and_what_comes_after_still_works() -> None:
    recorded = loops(np.array([0.0, 0.01, 0.01, 0.0]), 2)
    settled = BackendConfig(
        settle_updates=30, relinearize_m=0.01, relinearize_rad=0.001, relinearize_calibration=0.0005
    )
    graph = PoseGraph(settled, PRIOR)
    drive(graph, recorded, {k: k - 80 for k in range(80, 160, 20)})
    graph.settle()
    before, covariance = graph.poses(), graph.covariance(160)
    graph.restart(graph.calibrations(), before)
    assert graph.pending
    graph.update(work=math.inf)
    assert not graph.pending
    np.testing.assert_allclose(between_all(before, graph.poses()), 0, atol=0.015)
    np.testing.assert_allclose(graph.covariance(160), covariance, rtol=0.05, atol=1e-6)
    removed = next(n for n, f in graph.factors().items() if isinstance(f, BetweenFactor))
    graph.remove(removed)
    summary = graph.update()
    assert (summary.added, summary.removed, summary.factors) == (0, 1, 163)


def test_restarting_from_far_away_finds_the_same_solution() -> None:
    recorded = loops(np.zeros(4), 2)
    graph = PoseGraph(BackendConfig(), PRIOR)
    drive(graph, recorded, {k: k - 80 for k in range(80, 161, 10)})
    graph.settle()
    before = graph.poses()
    off = before + np.random.default_rng(1).normal(0, [0.5, 0.5, 0.1], before.shape)
    graph.restart(np.array([0.0, 0.0, 0.01, 0.0]), off)
    graph.update()
    np.testing.assert_allclose(graph.poses()[:, :2], before[:, :2], atol=0.02)


def test_keyframes_that_come_after_a_restart_was_asked_for_follow_on_from_it() -> None:
    graph = chain(ARC)
    turned = np.array([(Pose2(0.0, 0.0, 0.0) @ T).array() for T in (graph.pose(k) for k in range(11))])
    step = Pose2(0.5, 0.0, 0.0)
    graph.restart(np.zeros(4), turned)
    graph.add_keyframe(graph.pose(10) @ step)
    graph.add(BetweenFactor(10, 11, step, STEP))
    summary = graph.update()
    assert (summary.added, summary.factors) == (1, 11)
    assert graph.pose(11).distance(graph.pose(10) @ step) < 1e-6


def test_a_rebuild_of_a_large_graph_takes_several_updates_of_bounded_work_and_comes_to_the_same() -> None:
    recorded = loops(np.array([0.0, 0.0, 0.02, 0.0]), 2)
    graphs = [PoseGraph(BackendConfig(), PRIOR) for _ in range(2)]
    for graph, work in zip(graphs, (math.inf, 200), strict=True):
        drive(graph, recorded, {})
        graph.add(BetweenFactor(0, 160, Pose2(), CLOSURE))
        updates = 1
        while not graph.update(work).moved:
            assert graph.restarts
            assert errors_m(graph, recorded.truth)[-1] > 1.0
            updates += 1
        assert not graph.restarts
        assert updates == 1 if work == math.inf else 3 < updates < 100
    np.testing.assert_allclose(graphs[0].poses(), graphs[1].poses(), atol=1e-9)


def test_what_comes_and_goes_during_a_rebuild_is_in_its_result() -> None:
    recorded = loops(np.array([0.0, 0.0, 0.02, 0.0]), 2)
    graph = PoseGraph(BackendConfig(), PRIOR)
    drive(graph, recorded, {})
    gone = graph.add(BetweenFactor(0, 80, Pose2(3.0, 0.0, 0.0), CLOSURE))
    graph.update(work=1)
    graph.remove(gone)
    end = graph.keyframes
    graph.add_keyframe(graph.pose(end - 1) @ Pose2(0.5, 0.0, 0.0))
    graph.add(BetweenFactor(end - 1, end, Pose2(0.5, 0.0, 0.0), STEP))
    kept = graph.add(BetweenFactor(0, 160, Pose2(), CLOSURE))
    assert graph.restarts
    while graph.restarts:
        graph.update(work=1)
    graph.settle()
    assert gone not in graph.factors()
    assert kept in graph.factors()
    assert errors_m(graph, recorded.truth)[160] < 0.1
    assert graph.pose(160).distance(graph.pose(end)) < 0.6


def test_a_rebuild_under_way_begins_again_after_a_checkpoint() -> None:
    recorded = loops(np.array([0.0, 0.0, 0.02, 0.0]), 2)
    graph = PoseGraph(BackendConfig(), PRIOR)
    drive(graph, recorded, {})
    graph.add(BetweenFactor(0, 160, Pose2(), CLOSURE))
    graph.update(work=1)
    restored: PoseGraph = pickle.loads(pickle.dumps(graph))
    assert restored.restarts
    for one in (graph, restored):
        one.settle()
    np.testing.assert_allclose(restored.poses(), graph.poses(), atol=0.02)


def test_a_restart_asked_for_during_a_rebuild_survives_a_checkpoint() -> None:
    """The last keyframe has two headings that fit, half a turn apart: the one it starts near stays."""
    recorded = loops(np.array([0.0, 0.0, 0.02, 0.0]), 2)
    graph = PoseGraph(BackendConfig(), PRIOR)
    drive(graph, recorded, {})
    end = graph.keyframes
    graph.add_keyframe(graph.pose(end - 1) @ Pose2(0.5, 0.0, 0.0))
    for turned in (1.6, -1.6):
        graph.add(BetweenFactor(end - 1, end, Pose2(0.5, 0.0, turned), STEP))
    graph.update()
    graph.restart(graph.calibrations(), graph.poses())
    graph.update(work=1)
    assert graph.restarts
    turned_round = graph.poses()
    turned_round[-1, 2] += np.pi
    graph.restart(graph.calibrations(), turned_round)
    restored: PoseGraph = pickle.loads(pickle.dumps(graph))
    restored.settle()
    assert abs(restored.pose(end - 1).between(restored.pose(end)).theta) > 3.0
