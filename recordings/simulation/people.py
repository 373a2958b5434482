"""People who walk near the robot: past it, along with it, or across its path. The laser sees their legs."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wayfi.recordings.simulation.drive import TrueMotion
from wayfi.recordings.simulation.surfaces import Surfaces, join, still

Floats = NDArray[np.float64]

SECONDS_PER_WALK = 25.0
WALK_S = (15.0, 45.0)
SPEED_M_S = (0.8, 1.5)
STEP_S = 0.5
LEG_RADIUS_M = 0.07
FEET_APART_M = 0.18
CLEARANCE_M = 0.35
LEG = LEG_RADIUS_M * np.array([[np.cos(a), np.sin(a)] for a in np.arange(6) * np.pi / 3])


@dataclass(frozen=True, slots=True, eq=False)
class Walk:
    """A person's positions `xy` (k, 2) at `time_s` (k,), `STEP_S` apart: one step between two of them."""

    time_s: Floats
    xy: Floats


def people(drive: TrueMotion, aisle_m: float, rng: np.random.Generator) -> Surfaces:
    """The legs of all people near the robot; none comes nearer than `CLEARANCE_M` to base_link.

    They walk up to `aisle_m` to each side of the robot's path.
    """
    drawn = [_legs(_draw_walk(drive, aisle_m, rng)) for _ in range(round(drive.duration_s / SECONDS_PER_WALK))]
    return join([still(np.empty((0, 4))), *(legs for legs in drawn if _keeps_distance(legs, drive))])


def _keeps_distance(legs: Surfaces, drive: TrueMotion) -> bool:
    """Whether `legs` stay `CLEARANCE_M` from the robot, checked at the ends and the middle of each motion."""
    for share in (0.0, 0.5, 1.0):
        elapsed = share * (legs.until_s - legs.since_s)
        corner = legs.ends[:, :2] + elapsed[:, None] * legs.velocity_xy
        gap = corner - drive.poses(legs.since_s + elapsed)[:, :2]
        if np.hypot(*gap.T).min() < CLEARANCE_M:
            return False
    return True


def _draw_walk(drive: TrueMotion, aisle_m: float, rng: np.random.Generator) -> Walk:
    """A random walk of one of the three kinds."""
    since_s = rng.uniform(0.0, drive.duration_s)
    kind = (_passer, _companion, _crosser)[rng.choice(3, p=[0.5, 0.25, 0.25])]
    return kind(drive, since_s + np.arange(0.0, rng.uniform(*WALK_S), STEP_S), aisle_m, rng)


def _passer(drive: TrueMotion, time_s: Floats, aisle_m: float, rng: np.random.Generator) -> Walk:
    """A walk along the robot's path at one side of it, in either direction."""
    velocity = rng.choice([-1.0, 1.0]) * rng.uniform(*SPEED_M_S)
    met_s, side = rng.choice(time_s), rng.choice([-1.0, 1.0]) * rng.uniform(0.85, 1.0) * aisle_m
    along = drive.distance_at(met_s) + velocity * (time_s - met_s)
    return Walk(time_s, _offset_from_path(drive, along, np.full(len(along), side)))


def _companion(drive: TrueMotion, time_s: Floats, aisle_m: float, rng: np.random.Generator) -> Walk:
    """A walk ahead of the robot or behind it, at its speed."""
    ahead_m, side = rng.choice([-1.0, 1.0]) * rng.uniform(1.0, 3.0), rng.uniform(-0.5, 0.5) * aisle_m
    along = np.array([drive.distance_at(t) for t in time_s]) + ahead_m
    return Walk(time_s, _offset_from_path(drive, along, np.full(len(along), side)))


def _crosser(drive: TrueMotion, time_s: Floats, aisle_m: float, rng: np.random.Generator) -> Walk:
    """A walk from one side of the aisle to the other, near the robot."""
    along, way = drive.distance_at(time_s[0]) + rng.uniform(-6.0, 10.0), rng.choice([-1.0, 1.0])
    side = np.arange(-aisle_m, aisle_m, rng.uniform(*SPEED_M_S) * STEP_S)
    steps = min(len(side), len(time_s))
    return Walk(time_s[:steps], _offset_from_path(drive, np.full(steps, along), way * side[:steps]))


def _offset_from_path(drive: TrueMotion, along_m: Floats, side_m: Floats) -> Floats:
    """(k, 2) positions at the distances `along_m` (k,) along the robot's path, `side_m` (k,) to the left of it."""
    pose = drive.at(along_m)
    left = np.stack([-np.sin(pose[:, 2]), np.cos(pose[:, 2])], axis=1)
    return np.asarray(pose[:, :2] + side_m[:, None] * left)


def _legs(walk: Walk) -> Surfaces:
    """Two alternating legs: a foot stands for one step, then swings to its next position during the other's step."""
    feet = _feet(walk.xy)
    foot, swings = np.repeat(np.arange(len(feet)), 2), np.tile([False, True], len(feet))
    moves_on = ~swings | (foot + 2 < len(feet))
    foot, swings = foot[moves_on], swings[moves_on]
    velocity_xy = np.zeros((len(foot), 2))
    velocity_xy[swings] = (feet[2:] - feet[:-2]) / STEP_S
    corners = feet[foot, None] + LEG
    ends = np.concatenate([corners, np.roll(corners, -1, axis=1)], axis=2).reshape(-1, 4)
    since_s, until_s, velocity = (
        np.repeat(each, len(LEG), axis=0)
        for each in (walk.time_s[foot + swings], walk.time_s[foot + swings + 1], velocity_xy)
    )
    return Surfaces(ends, since_s, until_s, velocity, np.zeros(len(ends), np.int8))


def _feet(xy: Floats) -> Floats:
    """(k - 1, 2) positions of the feet on the way through `xy` (k, 2), left and right alternately."""
    step = np.diff(xy, axis=0)
    left = np.stack([-step[:, 1], step[:, 0]], axis=1) / np.maximum(np.hypot(*step.T), 1e-9)[:, None]
    sides = np.where(np.arange(len(step)) % 2 == 0, 0.5, -0.5) * FEET_APART_M
    return np.asarray(xy[:-1] + step / 2 + sides[:, None] * left)
