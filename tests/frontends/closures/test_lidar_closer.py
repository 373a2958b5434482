"""Loops closed by the laser, proposed by the estimate and by WiFi; closures that prove wrong are taken back."""

from dataclasses import replace

import numpy as np
from circles import Circles, S, drive

from wayfi.backend.graph.factors import BetweenFactor
from wayfi.backend.pose2 import Pose2
from wayfi.frontends.closures.closure_config import ClosureConfig
from wayfi.frontends.closures.lidar_closer import LidarCloser
from wayfi.frontends.events import CheckDone, ClosureJudged, ClosureKind, Event, Verdict
from wayfi.frontends.lidar.lidar_config import LidarConfig


def closer(run: Circles, config: ClosureConfig | None = None) -> LidarCloser:
    return LidarCloser(run.graph, run.keyframes, run.verdicts, config or ClosureConfig(), LidarConfig())


def judged(events: list[Event]) -> list[ClosureJudged]:
    return [event for event in events if isinstance(event, ClosureJudged)]


def test_the_estimate_proposes_the_laser_checks_and_the_graph_believes() -> None:
    run = drive(2.2, bias=0.01)
    b = run.last
    check, verdict = closer(run).close_by_estimate(b, 7, run.poses())
    assert isinstance(check, CheckDone)
    assert isinstance(verdict, ClosureJudged)
    assert (verdict.verdict, verdict.kind, verdict.proposed_by) == (Verdict.ACCEPTED, ClosureKind.LIDAR, "estimate")
    assert (check.keyframe_b, verdict.keyframe_b, verdict.stamp_b_ns) == (b, b, b * S)
    assert verdict.T_a_b.distance(run.truth[verdict.keyframe_a].between(run.truth[b])) < 0.1
    before = run.graph.pose(b).distance(run.truth[b])
    assert run.graph.pending
    run.graph.update()
    assert run.graph.pose(b).distance(run.truth[b]) < max(0.5 * before, 0.15)


def test_checks_keep_their_distance_and_need_a_scan() -> None:
    run = drive(2.2)
    closing = closer(run)
    assert len(closing.close_by_estimate(run.last - 1, 0, run.poses())) == 2
    assert closing.close_by_estimate(run.last, 0, run.poses()) == []
    blind = drive(2.2, laser=False)
    assert closer(blind).close_by_estimate(blind.last, 0, blind.poses()) == []
    short = drive(0.9)
    assert closer(short).close_by_estimate(15, 0, short.poses()) == []


def test_wifi_proposes_and_the_laser_gives_the_pose() -> None:
    run = drive(2.2, bias=0.005)
    candidate = run.candidate(3, run.last)
    assert closer(run).can_check(candidate)
    outcome = closer(run).close_by_wifi(candidate, 0, run.poses())
    check, verdict = outcome.events
    assert outcome.closed
    assert not outcome.open
    assert isinstance(check, CheckDone)
    assert isinstance(verdict, ClosureJudged)
    assert (verdict.kind, verdict.proposed_by, verdict.similarity) == (ClosureKind.LIDAR, "wifi", 0.7)


def test_the_laser_sees_no_candidate_without_scans_and_closes_no_keyframe_with_itself() -> None:
    blind, run = drive(0.5, laser=False), drive(0.5)
    assert not closer(blind).can_check(blind.candidate(0, 5))
    assert not closer(run).can_check(run.candidate(5, 5))


def test_wifi_that_contradicts_the_estimate_is_refused_before_the_laser_is_asked() -> None:
    run = drive(2.2)
    opposite = run.candidate(run.last - run.per_round * 3 // 2, run.last, sigma_m=0.1)
    outcome = closer(run).close_by_wifi(opposite, 0, run.poses())
    (verdict,) = judged(outcome.events)
    assert outcome.events == [verdict]
    assert not outcome.closed
    assert (verdict.verdict, verdict.proposed_by) == (Verdict.REFUSED, "wifi")
    assert "WiFi contradicts the estimate" in verdict.reason


def test_a_candidate_is_open_where_the_estimate_knows_less_than_wifi_claims() -> None:
    run, never = drive(2.2, bias=0.005), replace(ClosureConfig(), min_inlier_ratio=1.1)
    for sigma_m, is_open in ((0.01, True), (2.0, False)):
        outcome = closer(run, never).close_by_wifi(run.candidate(3, run.last, sigma_m), 0, run.poses())
        assert (outcome.closed, outcome.open) == (False, is_open)


def test_what_walls_say_of_a_wifi_candidate_is_kept_until_scans_are_withdrawn() -> None:
    run, fixed = drive(2.2, bias=0.005), ClosureConfig()
    candidate = run.candidate(3, run.last)
    closing = closer(run, replace(fixed, max_sigma_m=1e-6))  # as if every place were a corridor
    assert closing.walls(candidate) is None
    closing.close_by_wifi(candidate, 0, run.poses())
    walls = closing.walls(candidate)
    assert walls is not None
    assert (walls.a, walls.b) == (3, run.last)
    assert np.linalg.eigvalsh(walls.covariance)[-1] >= fixed.open_sigma_m**2
    for sigma_m, is_open in ((0.1, True), (100.0, False)):  # of WiFi, beside which the estimate is loose, or sure
        assert closing.close_by_wifi(run.candidate(3, run.last, sigma_m), 0, run.poses()).open is is_open
    closing.withdraw("the scans are forgotten")
    assert closing.walls(candidate) is None


def test_wifi_is_not_asked_where_the_way_is_closed() -> None:
    run = drive(2.2)
    closing = closer(run, replace(ClosureConfig(), closed_m=1000.0))
    outcome = closing.close_by_wifi(run.candidate(3, run.last), 0, run.poses())
    assert (outcome.events, outcome.closed, outcome.open) == ([], False, False)


def test_a_candidate_with_too_few_points_is_refused_for_that() -> None:
    run = drive(2.2)
    blind = LidarCloser(run.graph, run.keyframes, run.verdicts, ClosureConfig(), LidarConfig(min_points=100_000))
    (verdict,) = judged(blind.close_by_estimate(run.last, 0, run.poses()))
    assert (verdict.verdict, verdict.reason) == (Verdict.REFUSED, "too few points to check")


def test_what_contradicts_the_estimate_is_refused_and_leaves_the_graph_alone() -> None:
    run = drive(2.2)
    before, factors = run.poses(), run.graph.factors()
    strict = replace(ClosureConfig(), gate_chi2=1e-9)
    (verdict,) = judged(closer(run, strict).close_by_estimate(run.last, 0, before))
    assert verdict.verdict is Verdict.REFUSED
    assert "contradicts the estimate" in verdict.reason
    run.graph.update()
    assert run.graph.factors() == factors
    np.testing.assert_array_equal(run.poses(), before)


def test_a_closure_that_the_others_contradict_is_taken_back() -> None:
    run = drive(2.2, bias=0.01)
    closing = closer(run)
    (accepted,) = judged(closing.close_by_estimate(run.last, 0, run.poses()))
    assert accepted.verdict is Verdict.ACCEPTED
    run.graph.update()
    assert closing.review(run.poses()) == []
    elsewhere = accepted.T_a_b @ Pose2(1.0, 0.0, 0.0)
    run.graph.add(BetweenFactor(accepted.keyframe_a, run.last, elsewhere, np.diag([1e-6, 1e-6, 1e-7])))
    run.graph.update()
    (removed,) = judged(closing.review(run.poses()))
    assert (removed.closure, removed.verdict) == (accepted.closure, Verdict.REMOVED)
    assert run.graph.pending
    run.graph.update()
    assert closing.review(run.poses()) == []
    T = run.graph.pose(accepted.keyframe_a).between(run.graph.pose(run.last))
    assert T.distance(elsewhere) < 0.01
