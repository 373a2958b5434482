"""How the robot moves: along a rounded route, slower in turns, with stops. This is the truth."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from wayfi.backend.pose2 import wrap_all

Floats = NDArray[np.float64]

STEP_M = 0.02
TURN_RATE_RAD_S = 0.6
ACCELERATION_M_S2 = 0.3
ROUNDING_M = 0.6
WIGGLE_LENGTH_M = 4.0
FIRST_STOP_S = 2.0
METRES_PER_STOP = 65.0


@dataclass(frozen=True, slots=True, eq=False)
class RoutePlan:
    """Where to drive: through `corners` (n, 2) m from the first on, until `length_m` of path are done, in `duration_s`.

    The path strays up to about `wiggle_m` from the straight lines, so that no two passes of a lane are the same. Where
    nothing is in the way the robot goes at `cruise_m_s`.
    """

    corners: Floats
    length_m: float
    duration_s: float
    wiggle_m: float
    cruise_m_s: float = 0.48


@dataclass(frozen=True, slots=True, eq=False)
class TrueMotion:
    """The true motion: `distance_m` (n,) done at `time_s` (n,), and the `path` (k, 3), x, y, theta at `path_m` (k,).

    theta is unwrapped.
    """

    time_s: Floats
    distance_m: Floats
    path_m: Floats
    path: Floats

    def poses(self, time_s: Floats) -> Floats:
        """(m, 3) true T_map_base at `time_s` (m,) into the drive; it stands still before and after."""
        return self.at(np.interp(time_s, self.time_s, self.distance_m))

    def at(self, at_m: Floats) -> Floats:
        """(m, 3) T_map_base at `at_m` (m,) of the path."""
        x, y, theta = (np.interp(at_m, self.path_m, self.path[:, k]) for k in range(3))
        return np.stack([x, y, wrap_all(theta)], axis=1)

    def gone_m(self, time_s: float) -> float:
        """Path (m) done until `time_s`."""
        return float(np.interp(time_s, self.time_s, self.distance_m))

    @property
    def duration_s(self) -> float:
        """Seconds from the first to the last moment."""
        return float(self.time_s[-1])


def drive(plan: RoutePlan, rng: np.random.Generator) -> TrueMotion:
    """Drives `plan`; the stops are where `rng` has them, and long enough to end at the planned duration."""
    path_m, path = _rounded(plan, rng)
    stops = _stops(len(path_m), plan.length_m, rng)
    moving_s = _times(_speeds(path_m, path[:, 2], stops, plan.cruise_m_s))
    weights = rng.uniform(0.3, 1.7, len(stops))
    pauses = weights / weights.sum() * max(plan.duration_s - FIRST_STOP_S - moving_s[-1], 0.0)
    return _with_pauses(path_m, path, moving_s, np.r_[0, stops], np.r_[FIRST_STOP_S, pauses])


def _rounded(plan: RoutePlan, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Path lengths (k,), `STEP_M` apart, and poses (k, 3) (theta unwrapped) of the rounded and wiggled route."""
    xy = _resampled(plan.corners)
    xy = gaussian_filter1d(xy, ROUNDING_M / STEP_M, axis=0, mode="nearest")
    noise = gaussian_filter1d(rng.standard_normal(xy.shape), WIGGLE_LENGTH_M / STEP_M, axis=0)
    fade_in = 1.0 - np.exp(-((np.arange(len(xy)) * STEP_M / WIGGLE_LENGTH_M) ** 2))
    xy = _resampled(xy + plan.wiggle_m * np.tanh(noise / noise.std()) * fade_in[:, None])
    xy = xy[: round(plan.length_m / STEP_M) + 1]
    theta = np.unwrap(np.arctan2(np.gradient(xy[:, 1]), np.gradient(xy[:, 0])))
    path: Floats = np.column_stack([xy - xy[0], theta])
    path_m: Floats = np.arange(len(xy), dtype=np.float64) * STEP_M
    return path_m, path


def _resampled(xy: Floats) -> Floats:
    """The line through `xy` (n, 2), as points `STEP_M` apart."""
    along = np.r_[0.0, np.hypot(*np.diff(xy, axis=0).T).cumsum()]
    at = np.arange(0.0, along[-1], STEP_M)
    return np.column_stack([np.interp(at, along, xy[:, k]) for k in range(2)])


def _stops(steps: int, length_m: float, rng: np.random.Generator) -> NDArray[np.int64]:
    """Indices into the path where the robot halts, spread over it."""
    count = max(round(length_m / METRES_PER_STOP), 1)
    spread = (np.arange(count) + rng.uniform(0.25, 0.75, count)) / count
    return (spread * steps).astype(np.int64)


def _speeds(path_m: Floats, theta: Floats, stops: NDArray[np.int64], cruise_m_s: float) -> Floats:
    """(k,) speed in m/s at each step of the path: at rest at the ends and the stops, within the bounds in between."""
    curvature = np.abs(np.gradient(theta, path_m))
    limit = np.minimum(cruise_m_s, TURN_RATE_RAD_S / np.maximum(curvature, 1e-9)) ** 2
    limit[[0, -1]] = 0.0
    limit[stops] = 0.0
    gain = 2 * ACCELERATION_M_S2 * STEP_M
    for i in range(1, len(limit)):
        limit[i] = min(limit[i], limit[i - 1] + gain)
    for i in range(len(limit) - 2, -1, -1):
        limit[i] = min(limit[i], limit[i + 1] + gain)
    return np.asarray(np.sqrt(limit))


def _times(speeds: Floats) -> Floats:
    """(k,) seconds from the start, without pauses."""
    return np.asarray(np.r_[0.0, np.cumsum(2 * STEP_M / (speeds[1:] + speeds[:-1]))])


def _with_pauses(
    path_m: Floats, path: Floats, moving_s: Floats, stops: NDArray[np.int64], pauses: Floats
) -> TrueMotion:
    """The drive that waits `pauses` seconds at the path's indices `stops`."""
    waited = np.zeros(len(path_m))
    waited[stops] = pauses
    leaving = moving_s + waited.cumsum()
    time_s = np.concatenate([leaving - waited, leaving[stops]])
    distance_m = np.concatenate([path_m, path_m[stops]])
    order = np.lexsort((distance_m, time_s))
    return TrueMotion(time_s[order], distance_m[order], path_m, path)
