"""WiFi's pairs of places: believed together or not at all, whatever order they come in, and taken back if wrong."""

import math

import numpy as np
import pytest
from circles import PRIOR, Circles, S, drive

from wayfi.backend.graph.factors import AxisFactor, BetweenFactor, NearFactor, WheelFactor
from wayfi.backend.graph.pose_graph import PoseGraph
from wayfi.backend.pose2 import Pose2
from wayfi.frontends.axes.axis_headings import AxisHeadings
from wayfi.frontends.closures.closure_config import ConsensusConfig
from wayfi.frontends.closures.wifi_closer import JUDGED_AT_ONCE, WifiCloser
from wayfi.frontends.events import ClosureJudged, ClosureKind, Event, SequenceMatched, Verdict, Warned
from wayfi.frontends.odometry.odometry_config import AxesConfig
from wayfi.frontends.wifi.fingerprints import WifiCandidate
from wayfi.frontends.wifi.wifi_config import WifiConfig

SIGMA_M = 0.8


def closer(run: Circles, config: ConsensusConfig | None = None, walls: BetweenFactor | None = None) -> WifiCloser:
    used = config or ConsensusConfig()
    return WifiCloser(
        run.graph, run.keyframes, run.verdicts, PRIOR, used, WifiConfig(), lambda _: None, lambda _: walls
    )


def update(graph: PoseGraph) -> None:
    """Update until no rebuild is under way."""
    graph.update()
    while graph.restarts:
        graph.update()


def verdicts(run: Circles) -> list[ClosureJudged]:
    """As they stand."""
    return [run.verdicts[n] for n in range(len(run.verdicts))]


def accepted(run: Circles) -> list[ClosureJudged]:
    return [judged for judged in verdicts(run) if judged.verdict is Verdict.ACCEPTED]


def close(run: Circles, closing: WifiCloser, candidates: list[WifiCandidate]) -> list[Event]:
    """Feed candidates as the stream does, an update after each."""
    events: list[Event] = []
    for candidate in candidates:
        events += closing.judge(candidate, 7, run.poses())
        events += closing.decide(7, run.poses())
        update(run.graph)
        events += closing.review(run.poses())
        update(run.graph)
    return events


def rounds(run: Circles, every: int = 8) -> list[WifiCandidate]:
    """A place with the same one a round before."""
    return [run.candidate(b - run.per_round, b, SIGMA_M) for b in range(run.per_round, run.last, every)]


def false_ones(run: Circles, true: list[WifiCandidate], per_true: int, seed: int) -> list[WifiCandidate]:
    """Each true candidate with so many false ones of the same later place."""
    rng = np.random.default_rng(seed)
    mixed = []
    for candidate in true:
        b = candidate.b.keyframe
        earlier = [a for a in range(b - 60) if run.truth[a].distance(run.truth[b]) > 6]
        mixed += [run.candidate(int(a), b, SIGMA_M) for a in rng.choice(earlier, per_true)] if earlier else []
        mixed.append(candidate)
    return mixed


def test_a_pair_that_the_estimate_makes_likely_is_believed_and_claims_no_heading() -> None:
    run = drive(1.5, radius_m=8.0, laser=False)
    closing = closer(run)
    for k in range(run.last - 1):  # the wheels are known to be right
        run.graph.add(BetweenFactor(k, k + 2, run.truth[k].between(run.truth[k + 2]), np.diag([1e-6, 1e-6, 1e-8])))
    update(run.graph)
    a, b = 5, 5 + run.per_round
    at_a, at_b = Pose2(0.2, 0.1, 0.0), Pose2(-0.1, 0.3, 0.0)
    candidate = WifiCandidate(run.fingerprint(a, at_a), run.fingerprint(b, at_b), 0.7, SIGMA_M, True)
    shown, verdict = closing.judge(candidate, 9, run.poses())
    assert isinstance(shown, SequenceMatched)
    assert (shown.keyframe_a, shown.keyframe_b, shown.stamp_ns) == (a, b, 9)
    np.testing.assert_allclose(shown.points_a[0], (run.graph.pose(a) @ at_a).array()[:2])
    np.testing.assert_allclose(shown.points_b[0], (run.graph.pose(b) @ at_b).array()[:2])
    assert isinstance(verdict, ClosureJudged)
    assert (verdict.verdict, verdict.kind, verdict.proposed_by) == (Verdict.ACCEPTED, ClosureKind.WIFI, "fingerprint")
    assert (verdict.stamp_a_ns, verdict.stamp_b_ns, verdict.heading_claimed) == (a * S, b * S, False)
    assert verdict.covariance[0, 0] == verdict.covariance[1, 1] == pytest.approx(SIGMA_M**2)
    np.testing.assert_allclose((verdict.T_a_b @ at_b).array()[:2], at_a.array()[:2], atol=1e-9)
    assert [type(f) for f in run.graph.factors().values()].count(NearFactor) == 1


def test_one_pair_alone_is_not_believed_while_the_wheels_are_unknown() -> None:
    run = drive(1.2, radius_m=8.0, bias=0.03, laser=False)
    before = run.poses()
    closing = closer(run)
    _, verdict = closing.judge(run.candidate(0, run.per_round), 0, before)
    assert isinstance(verdict, ClosureJudged)
    assert verdict.verdict is Verdict.REFUSED
    assert closing.decide(0, before) == []
    update(run.graph)
    np.testing.assert_array_equal(run.poses(), before)


def test_a_pair_that_is_not_each_others_best_is_never_believed() -> None:
    run = drive(2.0, radius_m=8.0, laser=False)
    closing = closer(run)
    candidates = [run.candidate(b - run.per_round, b, mutual=False) for b in range(run.per_round, run.last, 4)]
    close(run, closing, candidates)
    assert accepted(run) == []
    assert all("sounds more like another" in judged.reason for judged in verdicts(run))


@pytest.mark.parametrize("bias", [-0.05, 0.0, 0.03, 0.08])
def test_pairs_that_agree_tell_the_turn_bias(bias: float) -> None:
    run = drive(3.0, radius_m=8.0, bias=bias, laser=False)
    events = close(run, closer(run), rounds(run))
    run.graph.settle()
    if abs(bias) > 0.04:
        assert any(isinstance(event, Warned) and "turn bias" in event.text for event in events)
    assert run.worst_m() < 1.5
    found = run.graph.calibration().values
    assert abs(found[2] + found[1] / 8.0 - bias) < 0.002, "on a circle bias and turn scale are one"
    assert len(accepted(run)) > 0.9 * len(verdicts(run))


def test_in_a_round_hall_wifi_wins_over_the_axes_that_there_are_none_of() -> None:
    """A circle of 25 m is a straight corridor to wheels that may turn by themselves, until places come again."""
    run = drive(3.0, radius_m=25.0, laser=False)
    axes = AxisHeadings(run.graph, PRIOR, AxesConfig(enabled=True))
    for k, wheels in enumerate(run.graph.of_kind(WheelFactor)):
        axes.follow(k + 1, wheels.motion, float(wheels.covariance[2, 2]), run.poses()[: k + 1])
        if run.graph.pending:
            update(run.graph)
    assert len(run.graph.of_kind(AxisFactor)) > 100
    assert run.worst_m() > 30.0
    close(run, closer(run), rounds(run))
    run.graph.settle()
    assert not axes.decide_again(), "a known turn is no corridor"
    assert run.graph.of_kind(AxisFactor) == []
    assert run.worst_m() < 1.5


def test_a_restart_is_asked_for_once() -> None:
    """Several candidates may come before the next keyframe, with which a restart takes effect."""
    run = drive(3.0, radius_m=8.0, bias=0.08, laser=False)
    closing = closer(run)
    events: list[Event] = []
    poses = run.poses()
    for candidate in rounds(run):
        events += closing.judge(candidate, 7, poses)
        events += closing.decide(7, poses)
    assert sum(isinstance(event, Warned) for event in events) == 1
    for _ in range(2):
        update(run.graph)
        closing.review(run.poses())
        closing.decide(7, run.poses())
    assert len(accepted(run)) > 0.8 * len(verdicts(run))


def test_a_restart_whose_pairs_do_not_hold_is_undone() -> None:
    """Pairs that a turn bias of 0.08 would explain; then it turns out that the wheels have none."""
    run = drive(4.0, radius_m=8.0, laser=False)
    closing, before = closer(run), run.poses()
    round_if_biased = round(run.per_round * (1 / 8.0) / (1 / 8.0 + 0.08))
    pairs = [run.candidate(b - round_if_biased, b, SIGMA_M) for b in range(round_if_biased, run.last, 8)]
    events = [e for pair in pairs for e in (*closing.judge(pair, 7, before), *closing.decide(7, before))]
    assert any(isinstance(event, Warned) for event in events)
    assert accepted(run)
    update(run.graph)
    assert run.worst_m() > 3.0
    for k in range(run.last):
        run.graph.add(BetweenFactor(k, k + 1, run.truth[k].between(run.truth[k + 1]), np.diag([1e-6, 1e-6, 1e-8])))
    run.graph.settle()
    closing.review(run.poses())
    assert run.graph.restarts
    run.graph.settle()
    assert not accepted(run)
    assert run.worst_m() < 0.5


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("per_true", [1, 4])
def test_false_pairs_among_true_ones_do_not_move_the_map(per_true: int, seed: int) -> None:
    run = drive(3.0, radius_m=8.0, bias=0.05, laser=False, seed=seed)
    candidates = false_ones(run, rounds(run), per_true, seed)
    closing = closer(run)
    close(run, closing, candidates)
    closing.decide(0, run.poses(), last=True)
    run.graph.settle()
    closing.review(run.poses())
    run.graph.settle()
    assert run.worst_m() < 1.5
    far = [j for j in accepted(run) if run.truth[j.keyframe_a].distance(run.truth[j.keyframe_b]) > 3.0]
    assert far == []


def test_a_run_of_false_pairs_that_comes_first_is_taken_back() -> None:
    """Six places of the first round heard again half a round too early: they agree with each other, and are wrong."""
    run = drive(4.0, radius_m=8.0, bias=0.02, laser=False)
    half = run.per_round // 2
    wrong = [run.candidate(b - run.per_round - half // 2, b, SIGMA_M) for b in range(130, 160, 8)]
    true = [c for c in rounds(run) if c.b.keyframe >= 160]
    closing = closer(run)
    close(run, closing, wrong + true)
    closing.decide(0, run.poses(), last=True)
    run.graph.settle()
    closing.review(run.poses())
    run.graph.settle()
    assert run.worst_m() < 1.5
    assert {j.verdict for j in verdicts(run)[: len(wrong)]} <= {Verdict.REFUSED, Verdict.REMOVED}


def test_pairs_in_a_row_count_as_one_fix_for_each_stretch_that_shadows_alike() -> None:
    run = drive(3.0, radius_m=8.0, laser=False)
    close(run, closer(run), rounds(run, every=2))
    sigmas = [f.sigma_m for f in run.graph.factors().values() if isinstance(f, NearFactor)]
    assert len(sigmas) > 50
    independent = WifiConfig().independent_m
    assert max(sigmas) == pytest.approx(SIGMA_M * math.sqrt(independent / 1.0), rel=0.2)
    assert {j.proposed_by for j in accepted(run)[5:]} == {"sequence"}


def test_sigma_follows_what_the_accepted_pairs_show() -> None:
    """Claimed to 0.8 m; right to a few centimetres."""
    run = drive(4.0, radius_m=8.0, laser=False)
    close(run, closer(run), rounds(run, every=2))
    claimed = [math.sqrt(j.covariance[0, 0]) for j in verdicts(run)]
    assert claimed[0] == pytest.approx(SIGMA_M)
    assert claimed[-1] < 0.75 * SIGMA_M


def test_the_laser_adds_to_an_accepted_pair_what_walls_tell_and_takes_it_back() -> None:
    run = drive(2.0, radius_m=8.0, laser=False)
    a, b = 5, 5 + run.per_round
    T_a_b = run.truth[a].between(run.truth[b])
    walls = BetweenFactor(a, b, T_a_b @ Pose2(3.0, 0.0, 0.0), np.diag([900.0, 0.02**2, 0.004**2]))
    closing = closer(run, ConsensusConfig(min_posterior=0.0), walls)
    before = run.graph.factors()
    (*_, verdict) = closing.judge(run.candidate(a, b, SIGMA_M), 9, run.poses())
    assert isinstance(verdict, ClosureJudged)
    assert (verdict.verdict, verdict.kind, verdict.heading_claimed) == (
        Verdict.ACCEPTED, ClosureKind.WIFI, True
    )  # fmt: skip
    along_m, across_m, heading_rad = np.sqrt(np.diag(verdict.covariance))
    assert along_m == pytest.approx(SIGMA_M, rel=0.01)
    assert across_m == pytest.approx(0.02, rel=0.01)
    assert heading_rad == pytest.approx(0.004, rel=0.01)
    assert abs(verdict.T_a_b.x) < 0.1  # WiFi's places are one, whatever the walls' pose is along them
    added = [factor for number, factor in run.graph.factors().items() if number not in before]
    assert added[1] is walls
    run.graph.update()
    T = run.graph.pose(a).between(run.graph.pose(b))
    assert abs(T.theta - T_a_b.theta) < 0.01
    assert abs(T.y - walls.T_a_b.y) < 0.05
    closing.withdraw_walls()
    assert walls not in run.graph.factors().values()
    assert added[0] in run.graph.factors().values()


def test_a_review_judges_a_bounded_number_anew_and_goes_on_with_the_rest(monkeypatch: pytest.MonkeyPatch) -> None:
    run = drive(3.0, radius_m=8.0, laser=False)
    closing = closer(run)
    for candidate in rounds(run):
        closing.judge(candidate, 7, run.poses())
    asked: list[int] = []
    monkeypatch.setattr(WifiCloser, "_accept_if_likely", lambda _, claim, poses: asked.append(claim.number))  # noqa: ARG005
    open_ones = len(verdicts(run)) - len(accepted(run))
    assert open_ones > 3 * JUDGED_AT_ONCE
    closing.review(run.poses())
    assert len(asked) == JUDGED_AT_ONCE
    while closing.go_on(run.poses()) or closing._to_judge:
        pass
    assert len(asked) == len(set(asked)) <= open_ones
    closing.review(run.poses(), last=True)
    assert not closing._to_judge
