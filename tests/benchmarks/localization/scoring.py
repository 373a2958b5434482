"""The scores of one run of localisation against truth: when the right place was found, and what was claimed falsely.

A claim is a pose that was published while TRACKING or UNCERTAIN. Misses (nothing claimed) and false claims are apart.
A claim stands until the next one, or until the state takes it back, however rarely the robot publishes.
"""

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from enum import StrEnum
from typing import Any

import numpy as np

from wayfi.backend.graph.health import State
from wayfi.backend.pose2 import Floats, Pose2, compose_all, wrap_all
from wayfi.frontends.events import Event, PosePublished, StateChanged
from wayfi.frontends.measurements import SECOND_NS
from wayfi.recordings.trajectory import Flags, Stamps, Trajectory

CLAIMED = (State.TRACKING, State.UNCERTAIN)
MOVING_M_S, MOVING_RAD_S = 0.02, 0.02  # slower than this a robot stands


@dataclass(frozen=True, slots=True)
class Bounds:
    """A claim is right within the first two, and false beyond one of the last two; between them it is merely off."""

    right_m: float = 0.5
    right_rad: float = 0.1
    false_m: float = 1.0
    false_rad: float = 0.2


BY_LASER = Bounds()
BY_WIFI = Bounds(3.0, math.inf, 6.0, math.inf)  # without a laser: the place alone


class End(StrEnum):
    """What was claimed at the end of a run."""

    RIGHT = "right"
    OFF = "off"
    FALSE = "false"
    NOTHING = "nothing claimed"


@dataclass(frozen=True, slots=True)
class Claim:
    """A pose as it was published, in the map's frame; `known_ns` is the newest stamp that had come by then."""

    stamp_ns: int
    T_map_base: Pose2
    state: State
    known_ns: int


@dataclass(frozen=True, slots=True)
class Change:
    """A change of the state, with its reason."""

    stamp_ns: int
    state: State
    reason: str


@dataclass(frozen=True, slots=True)
class Run:
    """What came out of a run from `start_ns` to `end_ns`."""

    start_ns: int
    end_ns: int
    claims: Sequence[Claim]
    changes: Sequence[Change] = ()
    cpu_s: float = 0.0
    longest_ms: float = 0.0

    def part(self, start_ns: int, end_ns: int) -> "Run":
        """The run between two stamps."""
        claims = [c for c in self.claims if start_ns <= c.stamp_ns < end_ns]
        changes = [c for c in self.changes if start_ns <= c.stamp_ns < end_ns]
        return Run(start_ns, end_ns, claims, changes, self.cpu_s, self.longest_ms)


@dataclass(frozen=True, slots=True)
class Score:
    """Seconds are of driving, since the start. `found_s`: the first right claim with no false one after it.

    `false` counts claims beyond the bounds, `false_tracking` those of them while TRACKING; `off_tracking` counts those
    that are not right while TRACKING. `right_after` is the share of the time from `found_s` on with right claims.
    """

    found_s: float | None
    first_claim_s: float | None
    driven_s: float
    claims: int
    tracking: int
    right: int
    false: int
    false_tracking: int
    off_tracking: int
    worst_m: float
    worst_rad: float
    median_m: float | None
    rmse_m: float | None
    right_after: float
    end: End

    def to_dict(self) -> dict[str, Any]:
        """The fields as plain values for JSON."""
        return asdict(self)


def claims_and_changes(events: Sequence[Event], known_ns: int) -> tuple[list[Claim], list[Change]]:
    """What was claimed when the newest stamp was `known_ns`, and how the state changed."""
    poses = (e for e in events if isinstance(e, PosePublished) and e.state in CLAIMED)
    changes = (e for e in events if isinstance(e, StateChanged))
    return (
        [Claim(e.stamp_ns, e.T_map_base, e.state, known_ns) for e in poses],
        [Change(e.stamp_ns, e.state, e.reason) for e in changes],
    )


def errors(claims: Sequence[Claim], truth: Trajectory, T_truth_map: Pose2) -> tuple[Floats, Floats]:
    """(n,) m and (n,) rad between claims and truth."""
    if not claims:
        return np.empty(0), np.empty(0)
    claimed = compose_all(T_truth_map.array(), np.array([c.T_map_base.array() for c in claims]))
    true = truth.at(np.array([c.stamp_ns for c in claims], np.int64))
    return np.hypot(*(claimed - true)[:, :2].T), np.abs(wrap_all(claimed[:, 2] - true[:, 2]))


def driving_s(truth: Trajectory, start_ns: int, stamps_ns: Stamps) -> Floats:
    """(n,) seconds that the robot has moved since `start_ns`, at `stamps_ns` (n,)."""
    steps_s = np.diff(truth.seconds(truth.stamps_ns))
    steps = np.diff(truth.poses, axis=0)
    moved = np.hypot(steps[:, 0], steps[:, 1]) > MOVING_M_S * steps_s
    moved |= np.abs(wrap_all(steps[:, 2])) > MOVING_RAD_S * steps_s
    driven_s = np.concatenate([[0.0], np.cumsum(np.where(moved, steps_s, 0.0))])
    both = truth.seconds(np.concatenate([[start_ns], stamps_ns]).astype(np.int64))
    at_s = np.interp(both, truth.seconds(truth.stamps_ns), driven_s)
    return np.asarray(at_s[1:] - at_s[0])


def score(run: Run, truth: Trajectory, T_truth_map: Pose2, bounds: Bounds = BY_LASER, grace_s: float = 0.0) -> Score:
    """The score of a run; false claims of the first `grace_s` seconds are not counted."""
    stamps_ns = np.array([c.stamp_ns for c in run.claims], np.int64)
    error_m, error_rad = errors(run.claims, truth, T_truth_map)
    tracking = np.array([c.state is State.TRACKING for c in run.claims], bool)
    right = (error_m <= bounds.right_m) & (error_rad <= bounds.right_rad)
    false = (error_m > bounds.false_m) | (error_rad > bounds.false_rad)
    counted = stamps_ns >= run.start_ns + round(grace_s * SECOND_NS)
    seconds = driving_s(truth, run.start_ns, np.array([c.known_ns for c in run.claims], np.int64))
    found = _found(right, false)
    return Score(
        found_s=None if found is None else round(float(seconds[found]), 2),
        first_claim_s=round(float(seconds[0]), 2) if len(seconds) else None,
        driven_s=round(float(driving_s(truth, run.start_ns, np.array([run.end_ns], np.int64))[0]), 2),
        claims=len(stamps_ns),
        tracking=int(tracking.sum()),
        right=int(right.sum()),
        false=int((false & counted).sum()),
        false_tracking=int((false & tracking & counted).sum()),
        off_tracking=int((~right & tracking & counted).sum()),
        worst_m=round(float(error_m[counted].max(initial=0.0)), 3),
        worst_rad=round(float(error_rad[counted].max(initial=0.0)), 3),
        median_m=round(float(np.median(error_m)), 3) if len(error_m) else None,
        rmse_m=round(float(np.sqrt(np.mean(error_m**2))), 3) if len(error_m) else None,
        right_after=_right_after(run, stamps_ns, right, found),
        end=_end(run, stamps_ns, right, false),
    )


def _found(right: Flags, false: Flags) -> int | None:
    """The first right claim with no false one after it."""
    last_false = int(np.flatnonzero(false)[-1]) if false.any() else -1
    after = np.flatnonzero(right[last_false + 1 :])
    return last_false + 1 + int(after[0]) if after.size else None


def _right_after(run: Run, stamps_ns: Stamps, right: Flags, found: int | None) -> float:
    """The share of the time from the claim `found` to the end of the run in which a right claim stands.

    Whole seconds count, each that begins with such a claim or gets one.
    """
    if found is None:
        return 0.0
    begin_ns = int(stamps_ns[found])
    whole = np.arange(begin_ns, max(run.end_ns - SECOND_NS, begin_ns + 1), SECOND_NS)
    having = np.isin(np.arange(len(whole)), (stamps_ns[found:][right[found:]] - begin_ns) // SECOND_NS)
    newest = [_standing(run, stamps_ns, int(at_ns)) for at_ns in whole]
    having |= np.array([k is not None and bool(right[k]) for k in newest])
    return round(float(having.mean()), 3)


def _standing(run: Run, stamps_ns: Stamps, at_ns: int) -> int | None:
    """The number of the newest claim at a moment; None if there is none, or the state has taken it back since."""
    newest = int(np.searchsorted(stamps_ns, at_ns, side="right")) - 1
    if newest < 0:
        return None
    since = [c.state for c in run.changes if stamps_ns[newest] <= c.stamp_ns <= at_ns]
    return None if since and since[-1] not in CLAIMED else newest


def _end(run: Run, stamps_ns: Stamps, right: Flags, false: Flags) -> End:
    last = _standing(run, stamps_ns, run.end_ns)
    if last is None:
        return End.NOTHING
    return End.RIGHT if right[last] else End.FALSE if false[last] else End.OFF
