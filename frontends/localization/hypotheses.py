"""Where the robot may be: a hypothesis with its pose, its covariance, and the evidence for and against it."""

from collections import deque
from dataclasses import dataclass, field

import numpy as np

from wayfi.backend.pose2 import Floats, Pose2, wrap
from wayfi.frontends.localization.local_track import KEPT, LocalTrack, moved_covariance
from wayfi.frontends.localization.localization_config import ClaimConfig
from wayfi.frontends.localization.map_matching import Agreement, Fix

QUALITY_FIXES = 8  # in the mean quality, the newest ones: over fewer, now and then another building fits well
APART_SCALE = 4.0  # of the covariance after a scan that fits apart: wheels turn by more than they admit at times
SAME_M, SAME_RAD = 0.4, 0.15  # nearer than this, two hypotheses are one


@dataclass(slots=True, eq=False)
class Hypothesis:
    """The robot is at `T_map_base` on a `floor` at the local `keyframe`, with (3, 3) covariance in `map`.

    `evidence` (nats) sums what its fixes lack of a good fit; `proposed` searches found it. `quality` is the mean one of
    its last fixes, of all that `counted`. `agreed` fixes agree and none between them contradicts the map, over
    `agreed_m` of path and `agreed_rad` of turns; `all_agreed` if every one between them agrees. The last `unsure` ones
    do not, of which the last `contradicted` ones contradict the map. Only fixes at other places than the one before
    count.
    """

    T_map_base: Pose2
    covariance: Floats
    keyframe: int
    evidence: float = 0.0
    floor: int = 0
    proposed: int = 1
    quality: float = 1.0
    counted: int = 0
    agreed: int = 0
    all_agreed: bool = True
    agreed_from_m: float = 0.0
    agreed_to_m: float = 0.0
    agreed_rad: float = 0.0
    unsure: int = 0
    contradicted: int = 0
    _counted_at: Pose2 | None = None
    _history: deque[tuple[int, float]] = field(default_factory=lambda: deque(maxlen=KEPT))

    @property
    def agreed_m(self) -> float:
        """The path (m) along which the last fixes agreed."""
        return self.agreed_to_m - self.agreed_from_m if self.agreed else 0.0

    @property
    def is_new(self) -> bool:
        """Whether no scan has been compared yet, or none since it was doubted."""
        return self._counted_at is None

    def evidence_at(self, keyframe: int) -> float | None:
        """The evidence (nats) up to an earlier keyframe; None where it is not known any more."""
        return next((evidence for k, evidence in reversed(self._history) if k <= keyframe), None)

    def is_new_place(self, config: ClaimConfig) -> bool:
        """Whether a fix here is independent of the last one that counted."""
        return self._counted_at is None or _apart_m(self._counted_at, self.T_map_base) >= config.apart_m

    def move_to_next(self, track: LocalTrack) -> None:
        """Move along the local track to the next keyframe."""
        step = track.step_to(self.keyframe + 1)
        self.covariance = moved_covariance(self.covariance, self.T_map_base, step.pose, step.covariance)
        self.T_map_base = self.T_map_base @ step.pose
        self._history.append((self.keyframe, self.evidence))
        self.keyframe += 1

    def open_along(self, fix: Fix, sigma_m: float) -> None:
        """Leave the place open to `sigma_m` along walls that do so: the place found there was one of many."""
        eigenvalues, directions = np.linalg.eigh(fix.covariance[:2, :2])
        if eigenvalues[1] > sigma_m**2:
            self.covariance[:2, :2] += sigma_m**2 * np.outer(directions[:, 1], directions[:, 1])

    def doubt(self) -> None:
        """The robot may have been moved: what agreed before says nothing of now."""
        self.agreed, self._counted_at = 0, None

    def update(self, fix: Fix, path_m: float, config: ClaimConfig) -> None:
        """Correct the pose by a fix that agrees, and count what the fix says if it is from another place."""
        counts, before = self.is_new_place(config), self._counted_at
        if fix.agreement is Agreement.AGREES:
            self._correct(fix)
        elif fix.agreement is Agreement.APART:
            self.covariance = APART_SCALE * self.covariance
        if counts:
            self._counted_at = self.T_map_base
            turned = abs(wrap(self.T_map_base.theta - before.theta)) if before else 0.0
            self._count(fix, path_m, turned, config)

    def _count(self, fix: Fix, path_m: float, turned: float, config: ClaimConfig) -> None:
        self.counted += 1
        self.quality += (fix.quality - self.quality) / min(self.counted, QUALITY_FIXES)
        self.evidence += config.evidence_per_fit * min(fix.quality - config.good_quality, 0.0)
        if fix.agreement is Agreement.AGREES:
            self.agreed_from_m = path_m if self.agreed == 0 else self.agreed_from_m
            self.agreed_rad = 0.0 if self.agreed == 0 else self.agreed_rad + turned
            self.all_agreed = self.agreed == 0 or (self.all_agreed and self.unsure == 0)
            self.agreed, self.agreed_to_m = self.agreed + 1, path_m
            self.unsure = self.contradicted = 0
            return
        self.unsure += 1
        self.contradicted = self.contradicted + 1 if fix.agreement is Agreement.CONTRADICTS else 0
        self.agreed = 0 if self.contradicted else self.agreed

    def _correct(self, fix: Fix) -> None:
        """Kalman update by a fix."""
        T, C = self.T_map_base, self.covariance
        e = T.error_of(fix.T_map_base)
        gain = C @ np.linalg.inv(C + fix.covariance)
        updated = C - gain @ C
        self.T_map_base, self.covariance = Pose2.of(T.array() + gain @ e), 0.5 * (updated + updated.T)


def is_same(a: Pose2, b: Pose2) -> bool:
    """Whether two poses are one hypothesis."""
    return a.distance(b) < SAME_M and abs(wrap(a.theta - b.theta)) < SAME_RAD


def _apart_m(a: Pose2, b: Pose2) -> float:
    """Distance (m) of two poses; a turn counts as 1 m a radian, for it shows other walls."""
    return a.distance(b) + abs(wrap(a.theta - b.theta))
