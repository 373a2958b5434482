"""The true motion of the robot: along a route with smoothed corners or turns on the spot, with stops."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from wayfi.backend.pose2 import wrap_all
from wayfi.recordings.simulation.spot_turns import PEAK_RAD_S, TurnedRoute, with_turns

Floats = NDArray[np.float64]

STEP_M = 0.02
ACCELERATION_M_S2 = 0.3
ROUNDING_M = 0.6
WIGGLE_LENGTH_M = 4.0
FIRST_STOP_S = 2.0
METRES_PER_STOP = 65.0


@dataclass(frozen=True, slots=True, eq=False)
class RoutePlan:
    """A route through `corners` (n, 2) m, which ends after `length_m` of path and takes `duration_s`.

    The path deviates up to about `wiggle_m` from the straight lines, so that no two passes of a lane are the same.
    `cruise_m_s` is the speed on straight parts. The corners are smoothed, or the robot turns `on_the_spot` there.
    """

    corners: Floats
    length_m: float
    duration_s: float
    wiggle_m: float
    cruise_m_s: float = 0.48
    on_the_spot: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class TrueMotion:
    """The true motion: the distance driven, `distance_m` (n,) at `time_s` (n,), and the path.

    The path is `path` (k, 3), x, y (m), theta (rad, unwrapped), at the distances `path_m` (k,).
    """

    time_s: Floats
    distance_m: Floats
    path_m: Floats
    path: Floats

    def poses(self, time_s: Floats) -> Floats:
        """(m, 3) T_map_base at `time_s` (m,) from the start; the first or last pose outside the drive."""
        return self.at(np.interp(time_s, self.time_s, self.distance_m))

    def at(self, at_m: Floats) -> Floats:
        """(m, 3) T_map_base at the distances `at_m` (m,) along the path."""
        x, y, theta = (np.interp(at_m, self.path_m, self.path[:, k]) for k in range(3))
        return np.stack([x, y, wrap_all(theta)], axis=1)

    def distance_at(self, time_s: float) -> float:
        """The distance (m) driven until `time_s`."""
        return float(np.interp(time_s, self.time_s, self.distance_m))

    @property
    def duration_s(self) -> float:
        """The duration of the drive in seconds."""
        return float(self.time_s[-1])


def drive(plan: RoutePlan, rng: np.random.Generator) -> TrueMotion:
    """The motion along `plan`, with random stops that fill the planned duration."""
    route = _angular(plan, rng) if plan.on_the_spot else _rounded(plan, rng)
    stops = _stops(len(route.path_m), plan.length_m, rng)
    moving_s = _times(_speeds(route, stops, plan.cruise_m_s), route.path_m)
    weights = rng.uniform(0.3, 1.7, len(stops))
    pauses = weights / weights.sum() * max(plan.duration_s - FIRST_STOP_S - moving_s[-1], 0.0)
    return _with_pauses(route, moving_s, np.r_[0, stops], np.r_[FIRST_STOP_S, pauses])


def _rounded(plan: RoutePlan, rng: np.random.Generator) -> TurnedRoute:
    """The route with smoothed corners and deviations, its poses `STEP_M` apart."""
    xy = gaussian_filter1d(_resampled(plan.corners), ROUNDING_M / STEP_M, axis=0, mode="nearest")
    xy = _resampled(xy + _deviation(len(xy), plan.wiggle_m, rng))
    xy = xy[: round(plan.length_m / STEP_M) + 1]
    theta = np.unwrap(np.arctan2(np.gradient(xy[:, 1]), np.gradient(xy[:, 0])))
    path_m: Floats = np.arange(len(xy), dtype=np.float64) * STEP_M
    return TurnedRoute(path_m, np.column_stack([xy - xy[0], theta]), np.full(len(xy), np.inf))


def _angular(plan: RoutePlan, rng: np.random.Generator) -> TurnedRoute:
    """The route with deviations and turns on the spot; straight along a line where it has no corner."""
    xy = _resampled(plan.corners)
    sides_m = np.hypot(*np.diff(plan.corners, axis=0).T)
    corners = np.round(sides_m.cumsum()[:-1] / STEP_M).astype(np.int64)
    xy[corners] = plan.corners[1:-1]  # between two points, a corner would bend a leg
    xy += _deviation(len(xy), plan.wiggle_m, rng)
    within = np.searchsorted(np.hypot(*np.diff(xy, axis=0).T).cumsum(), plan.length_m) + 1
    return with_turns(xy[: within + 1] - xy[0], corners[corners < within - 1])


def _deviation(count: int, wiggle_m: float, rng: np.random.Generator) -> Floats:
    """(count, 2) smooth random offsets of points `STEP_M` apart; none at the first."""
    noise = gaussian_filter1d(rng.standard_normal((count, 2)), WIGGLE_LENGTH_M / STEP_M, axis=0)
    fade_in = 1.0 - np.exp(-((np.arange(count) * STEP_M / WIGGLE_LENGTH_M) ** 2))
    return np.asarray(wiggle_m * np.tanh(noise / noise.std()) * fade_in[:, None])


def _resampled(xy: Floats) -> Floats:
    """Points (k, 2), `STEP_M` apart, on the line through `xy` (n, 2)."""
    along = np.r_[0.0, np.hypot(*np.diff(xy, axis=0).T).cumsum()]
    at = np.arange(0.0, along[-1], STEP_M)
    return np.column_stack([np.interp(at, along, xy[:, k]) for k in range(2)])


def _stops(steps: int, length_m: float, rng: np.random.Generator) -> NDArray[np.int64]:
    """Indices into the path where the robot stops, spread over the path."""
    count = max(round(length_m / METRES_PER_STOP), 1)
    spread = (np.arange(count) + rng.uniform(0.25, 0.75, count)) / count
    return (spread * steps).astype(np.int64)


def _speeds(route: TurnedRoute, stops: NDArray[np.int64], cruise_m_s: float) -> Floats:
    """(k,) speeds (m/s) along the route: 0 at the ends and stops, within the limits of turn rate and acceleration."""
    curvature = np.abs(np.gradient(route.path[:, 2], route.path_m))
    limit = np.minimum(cruise_m_s, PEAK_RAD_S / np.maximum(curvature, 1e-9))
    limit = np.where(np.isinf(route.limit_m_s), limit, route.limit_m_s) ** 2
    limit[[0, -1]] = 0.0
    limit[stops] = 0.0
    gain = 2 * ACCELERATION_M_S2 * np.diff(route.path_m)
    for i in range(1, len(limit)):
        limit[i] = min(limit[i], limit[i - 1] + gain[i - 1])
    for i in range(len(limit) - 2, -1, -1):
        limit[i] = min(limit[i], limit[i + 1] + gain[i])
    return np.asarray(np.sqrt(limit))


def _times(speeds: Floats, path_m: Floats) -> Floats:
    """(k,) seconds from the start to each of the distances `path_m` (k,), without stops."""
    return np.asarray(np.r_[0.0, np.cumsum(2 * np.diff(path_m) / (speeds[1:] + speeds[:-1]))])


def _with_pauses(route: TurnedRoute, moving_s: Floats, stops: NDArray[np.int64], pauses: Floats) -> TrueMotion:
    """The motion with `pauses` (s) at the indices `stops` of the route."""
    path_m, path = route.path_m, route.path
    waited = np.zeros(len(path_m))
    waited[stops] = pauses
    leaving = moving_s + waited.cumsum()
    time_s = np.concatenate([leaving - waited, leaving[stops]])
    distance_m = np.concatenate([path_m, path_m[stops]])
    order = np.lexsort((distance_m, time_s))
    return TrueMotion(time_s[order], distance_m[order], path_m, path)
