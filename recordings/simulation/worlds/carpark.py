"""The paper's car park: 30 x 200 m, two lanes, four rows of bays, pillars; cars park, leave and pass by."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.pose2 import Pose2
from wayfi.recordings.simulation.drive import RoutePlan, TrueMotion
from wayfi.recordings.simulation.radio import RadioPlan
from wayfi.recordings.simulation.surfaces import Surfaces, box, join, moving, polygon, still, transformed

Floats = NDArray[np.float64]

X_MIN_M, X_MAX_M, Y_MIN_M, Y_MAX_M = -10.0, 190.0, -7.5, 22.5
LANE_A_M, LANE_B_M = 0.0, 15.0
CROSSINGS_M = (-6.0, 26.0, 74.0, 126.0, 182.0)
CROSSING_WIDTH_M = 6.0
ROWS_M = (-5.0, 5.0, 10.0, 20.0)
ROW_START_M = 0.3
BAY_M = 2.5
PILLAR_M = 0.4
PILLAR_SPACING_M = 7.5
FULL_BAYS = 0.7
CHANGING_BAYS = 0.25
PASSING_CARS = 60
CLEARANCE_M = 0.6


def _corners() -> Floats:
    """The first loop is of 100 m."""
    west, one, two, three, east = CROSSINGS_M
    a, b = LANE_A_M, LANE_B_M
    first_loop = [(0.0, a), (one, a), (one, b), (west, b), (west, a)]
    far_loops = [(east, a), (east, b), (two, b), (two, a), (three, a), (three, b), (west, b), (west, a)]
    other_way = [(two, a), (two, b), (east, b), (east, a), (one, a), (one, b), (west, b), (west, a), (two, a)]
    return np.array(first_loop + far_loops + other_way)


def _corners_around() -> Floats:
    """The first loop is of 400 m, around the whole car park."""
    west, one, two, three, east = CROSSINGS_M
    a, b = LANE_A_M, LANE_B_M
    around = [(0.0, a), (east, a), (east, b), (west, b), (west, a)]
    back = [(two, a), (two, b), (east, b), (east, a), (one, a), (one, b), (west, b), (west, a)]
    middle = [(three, a), (three, b), (one, b), (one, a), (two, a)]
    return np.array(around + back + middle)


ROUTE = RoutePlan(_corners(), length_m=1070.0, duration_s=2580.0, wiggle_m=0.3)
ROUTE_AROUND = replace(ROUTE, corners=_corners_around())
RADIO = RadioPlan(
    inside=(X_MIN_M, Y_MIN_M, X_MAX_M, Y_MAX_M), inside_sites=5, margin_m=25.0, outside_sites=1140, hotspots=50
)


def surfaces(drive: TrueMotion, rng: np.random.Generator) -> Surfaces:
    """All walls, pillars and cars during `drive`."""
    shell = still(np.vstack([box(X_MIN_M, Y_MIN_M, X_MAX_M, Y_MAX_M), *_pillars()]))
    return join([shell, *_parked_cars(drive.duration_s, rng), *_passing_cars(drive, rng)])


def _pillars() -> list[Floats]:
    half = PILLAR_M / 2
    rows = [(ROWS_M[0] + ROWS_M[1]) / 2 - 2.75, 2.75, (ROWS_M[1] + ROWS_M[2]) / 2, 12.25, 17.75]
    xs = np.arange(X_MIN_M + ROW_START_M + PILLAR_SPACING_M, X_MAX_M, PILLAR_SPACING_M)
    return [box(x - half, y - half, x + half, y + half) for y in rows for x in xs if not _on_crossing(x, y, half)]


def _on_crossing(x: float, y: float, half_m: float) -> bool:
    """Whether an object that extends `half_m` to each side of x is in a crossing between the two lanes."""
    between = LANE_A_M < y < LANE_B_M
    return between and any(abs(x - c) < CROSSING_WIDTH_M / 2 + half_m for c in CROSSINGS_M)


def _car(rng: np.random.Generator) -> Floats:
    """(8, 4) faces (m) of a car around the origin, its front at +x."""
    length, width = rng.uniform(3.8, 4.6) / 2, rng.uniform(1.65, 1.9) / 2
    nose, flank = length - 0.35, width - 0.3
    quarter = np.array([[length, flank], [nose, width]])
    half = np.vstack([quarter, quarter[::-1] * [-1, 1]])
    return polygon(np.vstack([half, half[::-1] * [1, -1]]))


def _parked_cars(duration_s: float, rng: np.random.Generator) -> list[Surfaces]:
    cars = []
    for row in ROWS_M:
        for x in np.arange(X_MIN_M + ROW_START_M + BAY_M / 2, X_MAX_M - BAY_M / 2, BAY_M):
            full, changes = rng.random() < FULL_BAYS, rng.random() < CHANGING_BAYS
            change_s = rng.uniform(0.0, duration_s)
            shape = transformed(_car(rng), _parked_pose(x, row, rng))
            if _on_crossing(x, row, BAY_M / 2) or not (full or changes):
                continue
            since_s = change_s if changes and not full else -np.inf
            cars.append(still(shape, since_s, change_s if changes and full else np.inf))
    return cars


def _parked_pose(x: float, row_m: float, rng: np.random.Generator) -> Pose2:
    """The pose of a car in its bay: forwards or backwards, with small random offsets and angle."""
    outwards = rng.choice([-1.0, 1.0])
    theta = outwards * np.pi / 2 + rng.normal(0.0, 0.03)
    return Pose2(x + rng.uniform(-0.1, 0.1), row_m + rng.uniform(-0.05, 0.05), theta)


def _passing_cars(drive: TrueMotion, rng: np.random.Generator) -> list[Surfaces]:
    """Cars that drive on the right of a lane, and keep their distance from the robot."""
    return [
        car for car in (_passing_car(drive.duration_s, rng) for _ in range(PASSING_CARS)) if _keeps_distance(car, drive)
    ]


def _passing_car(duration_s: float, rng: np.random.Generator) -> Surfaces:
    lane, direction = rng.choice([LANE_A_M, LANE_B_M]), rng.choice([-1.0, 1.0])
    start_x, end_x = np.sort(rng.uniform(X_MIN_M + 5, X_MAX_M - 5, 2))[:: int(direction)]
    speed, since_s = rng.uniform(0.8, 3.0), rng.uniform(0.0, duration_s)
    shape = transformed(_car(rng), Pose2(start_x, lane - direction * 1.45, 0.0 if direction > 0 else np.pi))
    return moving(shape, since_s, since_s + abs(end_x - start_x) / speed, (direction * speed, 0.0))


def _keeps_distance(car: Surfaces, drive: TrueMotion) -> bool:
    """Whether the car stays more than `CLEARANCE_M` from the robot for its whole drive."""
    time_s = np.arange(car.since_s[0], car.until_s[0], 0.1)
    shift = car.velocity_xy[0] * (time_s - car.since_s[0])[:, None]
    xy = drive.poses(time_s)[:, :2] - shift
    low, high = car.ends[:, :2].min(axis=0), car.ends[:, :2].max(axis=0)
    outside = np.maximum(np.maximum(low - xy, xy - high), 0.0)
    return bool((np.hypot(*outside.T) > CLEARANCE_M).all())
