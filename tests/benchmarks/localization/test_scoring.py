"""The scores of a run tell right from false, and misses from both."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from benchmarks.localization.scoring import BY_WIFI, Change, Claim, End, Run, Score, score

from wayfi.backend.graph.health import State
from wayfi.backend.pose2 import Pose2
from wayfi.frontends.measurements import SECOND_NS
from wayfi.recordings.trajectory import Trajectory

START_NS = 1_700_000_000 * SECOND_NS
SECONDS = 60
T_TRUTH_MAP = Pose2(12.0, -3.0, 2.5)
STANDS_S = 20.0  # of the drive, at its beginning


def truth() -> Trajectory:
    """A robot that stands, then drives half a metre a second along a curve."""
    t = np.arange(0, SECONDS + 1, 0.1)
    driven_s = np.maximum(t - STANDS_S, 0.0)
    poses = np.column_stack([0.5 * driven_s, np.sin(driven_s / 9), 3.0 + driven_s / 10])
    return Trajectory(START_NS + np.round(t * SECOND_NS).astype(np.int64), poses)


def run_that_claims(off: Callable[[float], Pose2 | None], state: State = State.TRACKING) -> Run:
    """A claim ten times a second, `off`(seconds) of the truth in its own frame; none where that is None."""
    true = truth()
    claims = []
    for stamp_ns in range(START_NS, START_NS + SECONDS * SECOND_NS, SECOND_NS // 10):
        error = off((stamp_ns - START_NS) / SECOND_NS)
        if error is not None:
            T_truth_base = Pose2.of(true.at(np.array([stamp_ns]))[0])
            claims.append(Claim(stamp_ns, T_TRUTH_MAP.between(T_truth_base @ error), state, stamp_ns))
    return Run(START_NS, START_NS + SECONDS * SECOND_NS, claims)


def scored(off: Callable[[float], Pose2 | None], state: State = State.TRACKING, grace_s: float = 0.0) -> Score:
    return score(run_that_claims(off, state), truth(), T_TRUTH_MAP, grace_s=grace_s)


def test_one_that_always_claims_the_truth_is_right_from_the_start() -> None:
    found = scored(lambda _: Pose2())
    assert found.found_s == 0.0
    assert found.right == found.claims == found.tracking == 600
    assert (found.false, found.off_tracking, found.right_after, found.end) == (0, 0, 1.0, End.RIGHT)
    assert found.worst_m < 1e-6
    assert found.worst_rad < 1e-6


@pytest.mark.parametrize("error", [Pose2(1.1), Pose2(0.0, -1.1), Pose2(0.0, 0.0, 0.21), Pose2(0.0, 0.0, 3.1)])
def test_one_that_claims_wrong_is_false_all_the_way(error: Pose2) -> None:
    false = scored(lambda _: error)
    assert false.found_s is None
    assert false.first_claim_s == 0.0
    assert (false.false, false.false_tracking, false.right, false.end) == (600, 600, 0, End.FALSE)


@pytest.mark.parametrize("error", [Pose2(0.7), Pose2(0.0, 0.0, 0.15)])
def test_a_claim_between_right_and_false_is_off(error: Pose2) -> None:
    off = scored(lambda _: error)
    assert (off.right, off.false, off.off_tracking, off.end) == (0, 0, 600, End.OFF)


def test_one_that_claims_nothing_is_a_miss_and_not_false() -> None:
    miss = scored(lambda _: None)
    assert (miss.found_s, miss.first_claim_s, miss.claims, miss.false, miss.end) == (None, None, 0, 0, End.NOTHING)
    assert miss.median_m is None


def test_seconds_are_of_driving() -> None:
    late = scored(lambda t: Pose2() if t >= STANDS_S + 7 else None)
    assert late.found_s == pytest.approx(7.0, abs=0.2)
    assert late.driven_s == pytest.approx(SECONDS - STANDS_S, abs=0.2)


def test_a_pose_counts_from_when_it_was_known_not_from_its_stamp() -> None:
    run = run_that_claims(lambda _: Pose2())
    late = [replace(claim, known_ns=claim.known_ns + 30 * SECOND_NS) for claim in run.claims]
    found_s = score(replace(run, claims=late), truth(), T_TRUTH_MAP).found_s
    assert found_s == scored(lambda seconds: Pose2() if seconds >= 30.0 else None).found_s
    assert found_s > 0.0


def test_a_right_claim_before_a_false_one_does_not_stay() -> None:
    found = scored(lambda t: Pose2(5.0) if 30 <= t < 31 else Pose2())
    assert found.found_s == pytest.approx(31 - STANDS_S, abs=0.2)
    assert found.first_claim_s == 0.0
    assert found.false == 10


def test_an_error_in_the_grace_after_a_kidnapping_is_forgiven() -> None:
    assert scored(lambda t: Pose2(5.0) if t < 9.95 else Pose2(), grace_s=10.0).false == 0
    assert scored(lambda t: Pose2(5.0) if t < 11 else Pose2(), grace_s=10.0).false == 10


def test_the_end_of_a_run_is_scored_as_well() -> None:
    assert scored(lambda t: Pose2(32.0) if t > 59 else Pose2()).end is End.FALSE


def test_a_claim_that_was_taken_back_does_not_stand_any_more() -> None:
    run = run_that_claims(lambda t: None if t > 40 else Pose2())
    lost = Change(START_NS + 40 * SECOND_NS, State.LOST, "moved")
    gone = score(replace(run, changes=[lost]), truth(), T_TRUTH_MAP)
    assert (gone.end, gone.found_s) == (End.NOTHING, 0.0)
    assert gone.right_after == pytest.approx(40 / SECONDS, abs=0.03)
    doubted = score(replace(run, changes=[replace(lost, state=State.UNCERTAIN)]), truth(), T_TRUTH_MAP)
    assert (doubted.end, doubted.right_after) == (End.RIGHT, 1.0)


def test_a_claim_stands_until_the_next_however_rarely_the_robot_publishes() -> None:
    rare = run_that_claims(lambda t: Pose2() if round(10 * t) % 26 == 0 else None)
    found = score(rare, truth(), T_TRUTH_MAP)
    assert (found.claims, found.end, found.right_after) == (24, End.RIGHT, 1.0)
    false_then = run_that_claims(lambda t: Pose2(0.7 if 26 <= t < 28.6 else 0.0) if round(10 * t) % 26 == 0 else None)
    assert score(false_then, truth(), T_TRUTH_MAP).right_after == pytest.approx(1 - 2.6 / SECONDS, abs=0.02)
    ends_false = run_that_claims(lambda t: Pose2(5.0 if t > 57 else 0.0) if round(10 * t) % 26 == 0 else None)
    assert score(ends_false, truth(), T_TRUTH_MAP).end is End.FALSE


def test_what_is_claimed_while_uncertain_is_false_but_not_tracking() -> None:
    false = scored(lambda _: Pose2(3.0), State.UNCERTAIN)
    assert (false.false, false.false_tracking, false.tracking) == (600, 0, 0)


def test_without_a_laser_three_metres_are_right_whatever_the_heading() -> None:
    coarse = score(run_that_claims(lambda _: Pose2(2.9, 0.0, 2.0)), truth(), T_TRUTH_MAP, BY_WIFI)
    assert (coarse.right, coarse.false) == (600, 0)
    assert score(run_that_claims(lambda _: Pose2(6.1)), truth(), T_TRUTH_MAP, BY_WIFI).false == 600
