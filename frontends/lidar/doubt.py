"""Where laser and wheels disagree: what a step's scan says of the wheels, and how far the pose is in doubt for it."""

import math
from dataclasses import dataclass, field, replace
from enum import Enum

import numpy as np

from wayfi.backend.graph.health import Health, State, worse
from wayfi.backend.graph.wheel_calibration import WheelMotion
from wayfi.backend.options import option
from wayfi.backend.pose2 import Floats, Pose2


@dataclass(frozen=True)
class DoubtConfig:
    """When laser and wheels disagree, what may have happened then, and when the pose is in doubt."""

    seen_through: float = option(
        0.3, "", "of the walls in view: a scan that looks through more was taken elsewhere; sound refused ones had 0.26"
    )
    agree_chi2: float = option(25.0, "1", "of wheels against a match, which is no confirmation beyond")
    slip_chi2: float = option(100.0, "1", "as above: a slip, unless it is small; wheels are scaled for less")
    slip_m: float = option(0.08, "m", "less is no slip, however sure both are: a mount or a stamp may be off by it")
    slip_rad: float = option(0.08, "rad", "as above")
    slip_gain: float = option(0.1, "1", "of inlier ratio over the wheels' pose: where that fits as well, walls repeat")
    slips: int = option(3, "steps", "in a row that make the pose UNCERTAIN; sound robots were seen to slip in two")
    nearly: float = option(
        0.8, "", "of the least inlier ratio: such a match is no factor, but the wheels may have erred by what it says"
    )
    misfits: int = option(3, "scans", "in a row that fit nowhere in the map: LOST")
    agreeing: int = option(3, "scans", "in a row that fit and agree with the wheels: no doubt any more")
    moved_m: float = option(1.0, "m", "a robot that is nowhere near was moved by this at least")
    moved_rad: float = option(1.0, "rad", "as above; whoever carries it sets it down as it comes")
    moved_m_s: float = option(1.0, "m/s", "as fast as people carry or push a robot")
    look_s: float = option(1.0, "s", "between scans that are matched while the wheels stand: a tenth of the full cost")
    look_again_s: float = option(0.2, "s", "the same while in doubt: the laser leads, and must not lose track")


class Finding(Enum):
    """What the scan at the end of a step says of the wheels."""

    SILENT = "nothing: there is no submap, or it neither agrees nor contradicts"
    AGREES = "it fits where the wheels lead"
    SLIPPED = "it fits well, but not where the wheels lead"
    UNFIT = "it does not fit, and need not: what it sees is new, or hidden"
    MISFIT = "it looks through walls of the submap"


@dataclass(frozen=True, slots=True, eq=False)
class StepJudged:
    """A finding, its reason for the state, the (3, 3) covariance of what happened, and whether the wheels stood."""

    finding: Finding
    reason: str = ""
    covariance: Floats = field(default_factory=lambda: np.zeros((3, 3)))
    stood: bool = False


SILENT, AGREES = StepJudged(Finding.SILENT), StepJudged(Finding.AGREES)
UNFIT = StepJudged(Finding.UNFIT, "do not fit the map here")


def unfit(guess: Pose2, T: Pose2) -> StepJudged:
    """A scan that nearly fits at `T`, where the wheels lead to `guess`: either may be right."""
    e = guess.error_of(T)
    return StepJudged(Finding.UNFIT, UNFIT.reason, np.outer(e, e))


def slipped(motion: WheelMotion, guess: Pose2, T: Pose2) -> StepJudged:
    """A scan at `T` from the keyframe before, where the wheels lead to `guess`: the wheels erred by all of that."""
    e = guess.error_of(T)
    return StepJudged(Finding.SLIPPED, _disagreement(motion, T), np.outer(e, e), stands(motion.pose))


def misfit(motion: WheelMotion, config: DoubtConfig) -> StepJudged:
    """A scan that fits nowhere near: the robot was moved, as far as people do so in that time."""
    sigma_m = config.moved_m + config.moved_m_s * motion.seconds
    covariance = np.diag([sigma_m**2, sigma_m**2, config.moved_rad**2])
    return StepJudged(Finding.MISFIT, "do not fit the map here: the robot was moved, or the wheels slipped", covariance)


def blind(motion: WheelMotion, config: DoubtConfig) -> StepJudged:
    """A scan after some time in which nothing told of the robot's motion, where it may be in several places."""
    reason = f"fit nowhere for sure: for {motion.blind_s:.1f} s neither odometry nor scans came"
    return replace(misfit(motion, config), reason=reason)


def misses(motion: WheelMotion, e: Floats) -> bool:
    """Whether an error `e` (3,) of the wheels is over half of what they say; turning on the spot shifts a mount."""
    turned = abs(motion.pose.theta)
    driven_m = motion.path_m + TURNING_M * turned
    return bool(math.hypot(e[0], e[1]) > 0.5 * driven_m or abs(e[2]) > 0.5 * turned + STANDS_RAD)


def _disagreement(motion: WheelMotion, T: Pose2) -> str:
    """Which of laser and wheels moves how."""
    if stands(motion.pose):
        return f"the laser moves while the wheels stand still ({math.hypot(T.x, T.y):.2f} m, {T.theta:+.2f} rad)"
    if stands(T):
        return f"the wheels turn while the laser stands still ({motion.path_m:.2f} m, {motion.pose.theta:+.2f} rad)"
    wheels, laser = motion.pose, T
    said = f"{wheels.x:+.2f} m, {wheels.theta:+.2f} rad against {laser.x:+.2f} m, {laser.theta:+.2f} rad"
    if wheels.x * laser.x < 0 or wheels.theta * laser.theta < 0:
        return f"the wheels go the other way than the laser ({said})"
    return f"the wheels contradict the laser ({said})"


TURNING_M = 0.5  # per rad: a mount that is unknown, and wheels that skid as they turn
STANDS_M, STANDS_RAD = 0.05, 0.05  # what standing still leaves of a scan match, and of wheels that jitter


def stands(motion: Pose2) -> bool:
    """Whether a motion is standing still."""
    return math.hypot(motion.x, motion.y) < STANDS_M and abs(motion.theta) < STANDS_RAD


class Doubt:
    """The doubt that the last steps leave. It begins with steps that disagree, and ends with some that agree."""

    def __init__(self, config: DoubtConfig) -> None:
        self._config = config
        self._in_a_row = (Finding.SILENT, 0)
        self.health: Health | None = None

    @property
    def unsettled(self) -> bool:
        """Whether there is doubt, or the last step may be the first of some that disagree."""
        return self.health is not None or self._in_a_row[0] in (Finding.SLIPPED, Finding.UNFIT, Finding.MISFIT)

    def leapt(self, metres: float, radians: float = 0.0) -> None:
        """The odometry leapt, which counted as no motion; without scans nothing can tell, and no doubt ends."""
        if self._in_a_row[1] == 0:
            return
        self._in_a_row = (Finding.SILENT, 1)
        turned = f", and by {radians:.1f} rad" if radians > self._config.slip_rad else ""
        self.health = worse(self.health, Health(State.UNCERTAIN, f"the odometry leapt {metres:.1f} m{turned}"))

    def add(self, step: StepJudged) -> Floats:
        """Add the next step; returns the (3, 3) covariance that the wheels' has to grow by.

        One slip of wheels that roll changes nothing: a match may err as well, and the wheels' covariance scale follows.
        """
        if step.finding is Finding.SILENT:
            return step.covariance
        last, count = self._in_a_row
        count = count + 1 if last is step.finding else 1
        self._in_a_row = (step.finding, count)
        if step.finding is Finding.AGREES and count >= self._config.agreeing:
            self.health = None
        elif health := self._new_health(step, count):
            self.health = worse(self.health, health)
        alone = step.finding is Finding.SLIPPED and count == 1 and not step.stood
        return np.zeros((3, 3)) if alone else step.covariance

    def _new_health(self, step: StepJudged, count: int) -> Health | None:
        """The health for the `count`-th step in a row of one kind; None where it is no doubt."""
        config, scans = self._config, f"{count} scans in a row" if count > 1 else "the last scans"
        match step.finding:
            case Finding.MISFIT:
                return Health(State.LOST if count >= config.misfits else State.UNCERTAIN, f"{scans} {step.reason}")
            case Finding.UNFIT if count >= config.misfits:
                return Health(State.UNCERTAIN, f"{scans} {step.reason}")
            case Finding.SLIPPED if count >= config.slips:
                return Health(State.UNCERTAIN, step.reason)
        return None
