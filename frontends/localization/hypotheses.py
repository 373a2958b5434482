"""Where the robot may be: each hypothesis with its pose, its covariance, and the evidence for and against it."""

from dataclasses import dataclass, field

import numpy as np

from wayfi.backend.pose2 import Floats, Pose2, wrap
from wayfi.frontends.localization.local_track import LocalTrack, moved_covariance
from wayfi.frontends.localization.localization_config import ClaimConfig
from wayfi.frontends.localization.map_matching import Agreement, Fix

EVIDENCE_PER_FIT = 10.0  # nats of a scan that fits wholly over one that does not at all


@dataclass(slots=True, eq=False)
class Hypothesis:
    """The robot is at `T_map_base` at the local `keyframe`, with (3, 3) covariance in `map`.

    `evidence` (nats) is that of its fixes against no fit at all; `agreed` of its fixes agreed, from `agreed_from_m` of
    path on; `unsure` and `contradicted` count the last fixes in a row that did not agree, and that contradicted.
    """

    origin: str
    T_map_base: Pose2
    covariance: Floats
    keyframe: int
    evidence: float = 0.0
    fixes: int = 0
    agreed: int = 0
    agreed_from_m: float = 0.0
    agreed_to_m: float = 0.0
    unsure: int = 0
    contradicted: int = 0
    counted: Pose2 | None = None
    fits: list[float] = field(default_factory=list)

    def move_to(self, keyframe: int, track: LocalTrack) -> None:
        """Move along the local track to a later keyframe."""
        while self.keyframe < keyframe:
            step = track.step_to(self.keyframe + 1)
            self.covariance = moved_covariance(self.covariance, self.T_map_base, step.pose, step.covariance)
            self.T_map_base = self.T_map_base @ step.pose
            self.keyframe += 1
            if step.moved:
                self.doubt()

    def doubt(self) -> None:
        """The robot may have been moved: what agreed before says nothing of now."""
        self.agreed, self.counted = 0, None

    def update(self, fix: Fix, path_m: float, config: ClaimConfig) -> None:
        """Correct the pose by a fix that agrees, and count what the fix says if it is from another place."""
        apart = self.counted is None or _apart_m(self.counted, self.T_map_base) >= config.apart_m
        if fix.agreement is Agreement.AGREES:
            self._correct(fix)
        if apart:
            self.counted = self.T_map_base
            self._count(fix, path_m)
        elif fix.agreement is Agreement.AGREES:
            self.unsure = self.contradicted = 0

    def _count(self, fix: Fix, path_m: float) -> None:
        self.fixes += 1
        self.evidence += EVIDENCE_PER_FIT * (fix.fit - 1.0 - max(fix.seen_through - 0.1, 0.0))
        self.fits = [*self.fits[-9:], fix.fit]
        if fix.agreement is Agreement.AGREES:
            self.agreed_from_m = path_m if self.agreed == 0 else self.agreed_from_m
            self.agreed, self.agreed_to_m = self.agreed + 1, path_m
            self.unsure = self.contradicted = 0
            return
        self.unsure += 1
        if fix.agreement is Agreement.CONTRADICTS:
            self.contradicted += 1
            self.agreed = 0
        else:
            self.contradicted = 0

    def _correct(self, fix: Fix) -> None:
        """Kalman update by a fix."""
        T, C = self.T_map_base, self.covariance
        e = np.array([fix.T_map_base.x - T.x, fix.T_map_base.y - T.y, wrap(fix.T_map_base.theta - T.theta)])
        gain = C @ np.linalg.inv(C + fix.covariance)
        updated = C - gain @ C
        self.T_map_base, self.covariance = Pose2.of(T.array() + gain @ e), 0.5 * (updated + updated.T)


def is_same(a: Pose2, b: Pose2, metres: float, radians: float) -> bool:
    """Whether two poses are one."""
    return a.distance(b) < metres and abs(wrap(a.theta - b.theta)) < radians


def _apart_m(a: Pose2, b: Pose2) -> float:
    """Distance (m) of two poses; a turn counts as 1 m a radian, for it shows other walls."""
    return a.distance(b) + abs(wrap(a.theta - b.theta))
