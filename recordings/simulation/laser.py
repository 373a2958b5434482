"""A planar LiDAR: each face is rendered into the beams that it covers, and each beam keeps the nearest."""

import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from wayfi.recordings.simulation.surfaces import Surfaces

Floats = NDArray[np.float64]

# Hokuyo UST-20LX
BEAMS = 1081
ANGLE_MIN = math.radians(-135.0)
ANGLE_INCREMENT = math.radians(0.25)

SIGMA_M = 0.01
SIGMA_PER_M = 0.001
RESOLUTION_M = 0.001

SEAM = 1e-9  # tolerance, in beams or shares of a face, so that no beam passes between two adjacent faces


@dataclass(frozen=True, slots=True)
class LaserSpec:
    """A laser: `beams` from `angle_min`, `angle_increment` (rad) apart, with a scan every `period_ns`.

    Its mirror turns once in `turn_s`, which sets the time between beams. Half of the beams return from a white sheet
    at the distance `reach_m`. Ranges are multiples of `resolution_m`. A beam's light spreads by `divergence_rad`;
    `mixed_share` of the beams at an edge are mixed pixels.
    """

    beams: int
    angle_min: float
    angle_increment: float
    range_min_m: float
    range_max_m: float
    period_ns: int
    turn_s: float
    reach_m: float
    resolution_m: float = RESOLUTION_M
    divergence_rad: float = 0.0
    mixed_share: float = 0.15

    @property
    def time_increment_s(self) -> float:
        """Seconds from one beam to the next."""
        return self.turn_s * self.angle_increment / (2 * math.pi)

    @property
    def sweep_s(self) -> float:
        """Seconds from the first beam to the last."""
        return (self.beams - 1) * self.time_increment_s

    @property
    def bearings(self) -> Floats:
        """(beams,) bearings of the beams, rad."""
        return np.asarray(self.angle_min + self.angle_increment * np.arange(self.beams), np.float64)


UST_20LX = LaserSpec(BEAMS, ANGLE_MIN, ANGLE_INCREMENT, 0.06, 20.0, 100_000_000, turn_s=0.025, reach_m=60.0)


@dataclass(frozen=True, slots=True, eq=False)
class Sweeps:
    """Sweeps that begin at `time_s` (n,) and last `lasting_s`.

    The laser moves at constant velocity from `first` (n, 3) to `last` (n, 3), T_map_laser at the first and last beam.
    """

    time_s: Floats
    first: Floats
    last: Floats
    lasting_s: float


def instant_sweeps(poses: Floats, time_s: Floats) -> Sweeps:
    """Sweeps of no duration at the laser's `poses` (n, 3) and `time_s` (n,)."""
    return Sweeps(time_s, poses, poses, 0.0)


@dataclass(frozen=True, slots=True, eq=False)
class Hits:
    """The nearest face on each beam, (n, beams): `range_m` (inf: none), `incidence` and `material`.

    `incidence` is the cosine of the angle of incidence: 1 for a beam perpendicular to the face, 0 for a parallel one.
    """

    range_m: Floats
    incidence: Floats
    material: NDArray[np.int8]


def scans(
    surfaces: Surfaces, poses: Floats, time_s: Floats, rng: np.random.Generator, spec: LaserSpec = UST_20LX
) -> NDArray[np.float32]:
    """(n, beams) ranges (m, inf: no return) of an ideal laser at `poses` (n, 3) and `time_s` (n,), with noise."""
    exact = ranges(surfaces, poses, time_s, spec)
    noise = rng.standard_normal(exact.shape, dtype=np.float32)
    return quantized(exact + noise * (SIGMA_M + SIGMA_PER_M * np.where(np.isfinite(exact), exact, 0.0)), spec)


def quantized(measured: Floats, spec: LaserSpec) -> NDArray[np.float32]:
    """Ranges rounded to the laser's resolution; inf outside its range."""
    measured = np.round(measured / spec.resolution_m) * spec.resolution_m
    measured[~((measured >= spec.range_min_m) & (measured <= spec.range_max_m))] = np.inf
    return measured.astype(np.float32)


def ranges(surfaces: Surfaces, poses: Floats, time_s: Floats, spec: LaserSpec = UST_20LX) -> Floats:
    """(n, beams) exact ranges (m, inf beyond the maximum) at `poses` (n, 3) and `time_s` (n,)."""
    return hits(surfaces, instant_sweeps(poses, time_s), spec).range_m


def hits(surfaces: Surfaces, sweeps: Sweeps, spec: LaserSpec) -> Hits:
    """The nearest faces on the beams of `sweeps`, with laser and faces where they are at the time of each beam."""
    shape = (len(sweeps.time_s), spec.beams)
    range_m, incidence, face = np.full(shape, np.inf), np.ones(shape), np.full(shape, -1)
    near = surfaces.around(
        np.vstack([sweeps.first, sweeps.last])[:, :2],
        spec.range_max_m,
        sweeps.time_s.min(),
        sweeps.time_s.max() + sweeps.lasting_s,
    )
    _draw_all(
        near.ends, near.since_s, near.until_s, near.velocity_xy,
        sweeps.time_s, sweeps.first, sweeps.last, sweeps.lasting_s,
        np.cos(spec.bearings), np.sin(spec.bearings), spec.angle_min, spec.angle_increment, spec.range_max_m,
        range_m, incidence, face,
    )  # fmt: skip
    range_m[range_m > spec.range_max_m] = np.inf
    return Hits(range_m, incidence, np.r_[near.material, np.int8(0)][face])


@njit(cache=True)
def _draw_all(
    ends: Floats, since_s: Floats, until_s: Floats, velocity_xy: Floats,
    time_s: Floats, first: Floats, last: Floats, lasting_s: float,
    cos_b: Floats, sin_b: Floats, angle_min: float, increment: float, range_max_m: float,
    range_m: Floats, incidence: Floats, face: NDArray[np.int64],
) -> None:  # fmt: skip
    directions = np.empty((len(cos_b), 2))
    for j in range(len(time_s)):
        x, y = first[j, 0], first[j, 1]
        c, s = math.cos(first[j, 2]), math.sin(first[j, 2])
        gone_x, gone_y = last[j, 0] - x, last[j, 1] - y
        turn = (last[j, 2] - first[j, 2] + math.pi) % (2 * math.pi) - math.pi
        _aim(cos_b, sin_b, turn, directions)
        for i in range(len(ends)):
            if not (since_s[i] <= time_s[j] < until_s[i]):
                continue
            x1, y1, x2, y2 = ends[i, 0] - x, ends[i, 1] - y, ends[i, 2] - x, ends[i, 3] - y
            past_x, past_y = gone_x, gone_y
            if velocity_xy[i, 0] != 0.0 or velocity_xy[i, 1] != 0.0:
                dx, dy = velocity_xy[i] * (time_s[j] - since_s[i])
                x1, y1, x2, y2 = x1 + dx, y1 + dy, x2 + dx, y2 + dy
                past_x, past_y = gone_x - velocity_xy[i, 0] * lasting_s, gone_y - velocity_xy[i, 1] * lasting_s
            if min(x1, x2) > range_max_m or max(x1, x2) < -range_max_m:
                continue
            if min(y1, y2) > range_max_m or max(y1, y2) < -range_max_m:
                continue
            _draw(
                c * x1 + s * y1, c * y1 - s * x1, c * x2 + s * y2, c * y2 - s * x2,
                c * past_x + s * past_y, c * past_y - s * past_x, turn,
                angle_min, increment, directions, i, range_m[j], incidence[j], face[j],
            )  # fmt: skip


@njit(cache=True)
def _aim(cos_b: Floats, sin_b: Floats, turn: float, directions: Floats) -> None:
    """Fill `directions` with the unit vectors of the beams, in the laser's frame at the first beam.

    The laser turns by `turn` (rad) until the last beam. The angles are added by rotation, so that without a turn the
    directions are exactly `cos_b`, `sin_b`.
    """
    step_c, step_s = math.cos(turn / (len(cos_b) - 1)), math.sin(turn / (len(cos_b) - 1))
    c, s = 1.0, 0.0
    for b in range(len(cos_b)):
        directions[b, 0], directions[b, 1] = cos_b[b] * c - sin_b[b] * s, sin_b[b] * c + cos_b[b] * s
        c, s = c * step_c - s * step_s, s * step_c + c * step_s


@njit(cache=True)
def _draw(
    x1: float, y1: float, x2: float, y2: float, past_x: float, past_y: float, turn: float,
    angle_min: float, increment: float, directions: Floats,
    index: int, range_m: Floats, incidence: Floats, face: NDArray[np.int64],
) -> None:  # fmt: skip
    """Render the face from (x1, y1) to (x2, y2), in the laser's frame at the first beam, where it is the nearest.

    Until the last beam, the laser moves by (past_x, past_y) relative to the face, and turns by `turn`.
    """
    dx, dy = x2 - x1, y2 - y1
    length_sq = dx * dx + dy * dy
    cross = x1 * dy - y1 * dx
    start, end = (math.atan2(y1, x1), math.atan2(y2, x2)) if cross > 0 else (math.atan2(y2, x2), math.atan2(y1, x1))
    if end < start:
        end += 2 * math.pi
    gone_sq = past_x * past_x + past_y * past_y
    moves = gone_sq > 0.0 or turn != 0.0
    slack = 0.0
    if moves:
        nearest_sq = max(min(x1 * x1 + y1 * y1, x2 * x2 + y2 * y2), gone_sq)
        slack = abs(turn) + 1.6 * math.sqrt(gone_sq / nearest_sq)
    for full_turn in (0.0, -2 * math.pi):
        first = max(math.ceil((start - slack + full_turn - angle_min) / increment - SEAM), 0)
        last = min(math.floor((end + slack + full_turn - angle_min) / increment + SEAM), len(range_m) - 1)
        for b in range(first, last + 1):
            done = b / (len(range_m) - 1)
            from_x, from_y = x1 - done * past_x, y1 - done * past_y
            across = directions[b, 0] * dy - directions[b, 1] * dx
            if across == 0.0:
                continue
            r = (from_x * dy - from_y * dx) / across
            if r >= range_m[b]:
                continue
            if moves:
                along = ((r * directions[b, 0] - from_x) * dx + (r * directions[b, 1] - from_y) * dy) / length_sq
                if r <= 0.0 or along < -SEAM or along > 1.0 + SEAM:
                    continue
            range_m[b], incidence[b], face[b] = r, abs(across) / math.sqrt(length_sq), index
