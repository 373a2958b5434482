"""Maps of a small round drive, made by hand: true closures, and some that a test adds."""

import math

import numpy as np
from graphs import CLOSURE, PRIOR, STEP

from wayfi.backend.graph.backend_config import BackendConfig
from wayfi.backend.graph.factors import BetweenFactor, Factor
from wayfi.backend.grid.map_config import MapConfig
from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.calibration import Calibration
from wayfi.frontends.events import ClosureJudged, ClosureKind, Verdict
from wayfi.frontends.maps.building_map import BuildingMap, MapClosure, MapKeyframe
from wayfi.frontends.maps.optimising import OptimisingConfig, drawn
from wayfi.frontends.measurements import SECOND_NS
from wayfi.frontends.scan_points import ScanPoints

CONFIG = OptimisingConfig(BackendConfig(), MapConfig(), PRIOR)
AROUND = 60  # keyframes in a round of 30 m
WALLS = np.array([[x, y] for x in np.linspace(-3, 3, 40) for y in (-1.0, 1.0)])


def round_pose(k: int) -> Pose2:
    """The true pose of keyframe k, on a circle."""
    theta = 2 * math.pi * k / AROUND
    radius = 30.0 / (2 * math.pi)
    return Pose2.of((radius * math.sin(theta), radius * (1 - math.cos(theta)), theta))


def judged(number: int, a: int, b: int, T_a_b: Pose2, verdict: Verdict = Verdict.ACCEPTED) -> ClosureJudged:
    """A verdict on a laser closure."""
    return ClosureJudged(
        number, a * SECOND_NS, b * SECOND_NS, a, b, ClosureKind.LIDAR, "estimate", math.nan, 0.02, 0.9, T_a_b, CLOSURE,
        True, verdict, "agrees with the estimate" if verdict is Verdict.ACCEPTED else "inlier ratio 0.30 under 0.6",
    )  # fmt: skip


def round_map(rounds: int = 2, false: tuple[int, int, Pose2] | None = None) -> BuildingMap:
    """`rounds` rounds with a closure every 10 keyframes, one that was refused, and last a `false` one: a, b, T_a_b.

    The steps are true, and so are the closures; the poses are the true ones.
    """
    count = rounds * AROUND
    truth = [round_pose(k) for k in range(count)]
    steps: list[Factor] = [BetweenFactor(k - 1, k, truth[k - 1].between(truth[k]), STEP) for k in range(1, count)]
    pairs = [(b - AROUND, b, truth[b - AROUND].between(truth[b])) for b in range(AROUND, count, 10)]
    pairs += [false] if false else []
    factors = dict(enumerate([*steps, *(BetweenFactor(*pair, CLOSURE) for pair in pairs)]))
    closures = [MapClosure(judged(0, 0, 9, Pose2(), Verdict.REFUSED))]
    closures += [MapClosure(judged(n + 1, *pair), (len(steps) + n,)) for n, pair in enumerate(pairs)]
    scan = ScanPoints(WALLS, np.tile([0.0, 1.0], (len(WALLS), 1)), Pose2())
    keyframes = [MapKeyframe(k * SECOND_NS, 0.5 * k, scan, WALLS.astype(np.float32)) for k in range(count)]
    poses = np.array([pose.array() for pose in truth])
    return BuildingMap(
        keyframes, poses, np.zeros((count, 4)), factors, closures, [], {}, Calibration(PRIOR, {}),
        drawn(keyframes, poses, CONFIG.grid),
    )  # fmt: skip


def furthest_m(poses: Floats, others: Floats) -> float:
    """The largest distance (m) between poses (n, 3) of the same number."""
    return float(np.hypot(*(poses - others)[:, :2].T).max())
