"""Poses from outside on a drive in rounds, by wheels that turn by themselves."""

import math

import numpy as np
import pytest
from circles import Circles, S, drive

from wayfi.backend.graph.factors import BetweenFactor
from wayfi.backend.pose2 import Floats, Pose2, diagonal_covariance
from wayfi.frontends.closures.closure_config import ClosureConfig
from wayfi.frontends.closures.fix_closer import FixCloser, OutsideFix
from wayfi.frontends.events import ClosureJudged, ClosureKind, Dropped, DropReason, Event, Verdict, Warned

SURE = diagonal_covariance(0.05, 0.02)


def closer(run: Circles) -> FixCloser:
    return FixCloser(run.graph, run.keyframes, run.verdicts, ClosureConfig())


def fixed(
    closing: FixCloser, run: Circles, keyframe: int, off: Pose2 = Pose2(), covariance: Floats | None = SURE
) -> list[Event]:
    """A fix of the true pose at a keyframe, moved by `off` in the map."""
    T_k_base = Pose2(0.2, 0.01, 0.05)
    fix = OutsideFix(off @ run.truth[keyframe] @ T_k_base, covariance, T_k_base)
    events = closing.add(keyframe * S, keyframe, fix, run.poses())
    run.graph.update()
    return events + closing.review(run.poses())


def verdict_of(events: list[Event]) -> ClosureJudged:
    (judged,) = (event for event in events if isinstance(event, ClosureJudged))
    return judged


def test_a_fix_that_agrees_holds_the_drive_where_it_is() -> None:
    run = drive(6.0, bias=0.01, laser=False)
    closing = closer(run)
    for keyframe in (40, 80, run.last):
        judged = verdict_of(fixed(closing, run, keyframe))
        assert (judged.verdict, judged.kind, judged.keyframe_a) == (Verdict.ACCEPTED, ClosureKind.FIX, 0)
    assert run.graph.pose(run.last).distance(run.truth[-1]) < 0.15
    assert run.worst_m() < 0.4
    assert list(closing.factors()) == [0, 1, 2]


def test_what_it_claims_is_the_pose_in_the_first_keyframe() -> None:
    run = drive(3.0)
    judged = verdict_of(fixed(closer(run), run, 20))
    assert judged.T_a_b.distance(run.truth[20]) < 1e-9
    assert judged.T_a_b.theta == pytest.approx(run.truth[20].theta)
    assert judged.stamp_a_ns == 0


def test_a_covariance_is_turned_and_reaches_to_the_keyframe() -> None:
    """Sure along the map's x and unsure along its y; a heading that is not known says nothing."""
    run = drive(3.0)
    closing = closer(run)
    fixed(closing, run, 20, covariance=np.diag([0.01**2, 1.0, 100.0]))
    ((number,),) = closing.factors().values()
    factor = run.graph.factors()[number]
    assert isinstance(factor, BetweenFactor)
    assert factor.covariance[0, 0] < 4.0 + 0.1**2
    assert not run.verdicts[0].heading_claimed
    np.testing.assert_allclose(factor.covariance, factor.covariance.T)


def test_one_without_a_covariance_counts_as_configured() -> None:
    run = drive(3.0)
    closing = closer(run)
    fixed(closing, run, 20, covariance=None)
    ((number,),) = closing.factors().values()
    factor = run.graph.factors()[number]
    assert isinstance(factor, BetweenFactor)
    assert math.sqrt(factor.covariance[0, 0]) == pytest.approx(0.2, abs=0.03)


def test_one_wrong_fix_does_not_move_the_map() -> None:
    run = drive(6.0, bias=0.002)
    closing = closer(run)
    for keyframe in (30, 60):
        fixed(closing, run, keyframe)
    before = run.poses()
    judged = verdict_of(fixed(closing, run, 80, off=Pose2(6.0, 0.0, 0.0)))
    assert judged.verdict is Verdict.REFUSED
    assert "contradicts the estimate" in judged.reason
    assert np.abs(run.poses() - before).max() < 1e-9


def test_several_that_agree_are_believed_against_the_estimate() -> None:
    """A false closure has bent the drive, and holds it where the fixes do not."""
    run = drive(8.0, bias=0.0)
    closing = closer(run)
    fixed(closing, run, 30)
    run.graph.add(BetweenFactor(0, run.last, Pose2(4.0, 4.0, 1.0) @ run.truth[-1], diagonal_covariance(0.01, 0.002)))
    run.graph.settle()
    assert run.worst_m() > 2.0
    events = [e for keyframe in range(run.last - 50, run.last + 1, 10) for e in fixed(closing, run, keyframe)]
    accepted = [e for e in events if isinstance(e, ClosureJudged) and e.verdict is Verdict.ACCEPTED]
    assert any("other fixes" in e.reason for e in accepted)
    assert not any(isinstance(e, Warned) for e in events)


def test_fixes_in_another_frame_are_told_and_not_used() -> None:
    run = drive(6.0)
    closing = closer(run)
    frame = Pose2(50.0, -20.0, 2.0)
    events = [e for keyframe in range(5, run.last, 9) for e in fixed(closing, run, keyframe, off=frame)]
    assert closing.factors() == {}
    (told,) = (e.text for e in events if isinstance(e, Warned))
    assert "at 50.0 m, -20.0 m, 114 degrees of theirs" in told
    assert "wayfi align" in told


def test_a_marker_that_was_moved_is_no_majority() -> None:
    run = drive(6.0)
    closing = closer(run)
    fixed(closing, run, 10)
    for keyframe in range(50, 60):
        fixed(closing, run, keyframe, off=Pose2(2.0, 1.0, 0.3))
    assert list(closing.factors()) == [0]


def test_a_keyframe_has_one_fix_and_the_first_needs_none() -> None:
    run = drive(3.0)
    closing = closer(run)
    fixed(closing, run, 20)
    for keyframe in (0, 20):
        (dropped,) = fixed(closing, run, keyframe)
        assert isinstance(dropped, Dropped)
        assert dropped.reason is DropReason.ADDS_NOTHING


def test_fixes_wait_while_the_graph_begins_anew() -> None:
    run = drive(6.0, bias=0.01)
    closing = closer(run)
    run.graph.restart(run.graph.calibrations(), run.poses())
    assert closing.add(0, 40, OutsideFix(run.truth[40], SURE, Pose2()), run.poses()) == []
    run.graph.settle()
    assert verdict_of(closing.judge(run.poses())).verdict is Verdict.ACCEPTED


def test_an_accepted_fix_that_others_outvote_is_removed() -> None:
    run = drive(8.0, bias=0.01, laser=False)
    for k in range(60, run.last - 1):  # there the wheels are known to be right
        run.graph.add(BetweenFactor(k, k + 2, run.truth[k].between(run.truth[k + 2]), np.diag([1e-6, 1e-6, 1e-8])))
    run.graph.settle()
    closing = closer(run)
    wrong = verdict_of(fixed(closing, run, 90, off=Pose2(0.4, 0.0, 0.0), covariance=diagonal_covariance(0.02, 0.01)))
    assert wrong.verdict is Verdict.ACCEPTED
    for keyframe in (30, 60, 100, 120, 140):
        fixed(closing, run, keyframe, covariance=diagonal_covariance(0.02, 0.01))
    for _ in range(3):
        run.graph.settle()
        closing.review(run.poses())
    assert run.verdicts[wrong.closure].verdict is Verdict.REMOVED
