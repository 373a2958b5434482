"""Rooms with known walls, and what a laser sees of them: the geometry that tests of scan matching share."""

import math
from dataclasses import replace

import numpy as np

from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.lidar.laser_points import scan_from_points
from wayfi.frontends.lidar.lidar_config import LidarConfig
from wayfi.frontends.scan_points import ScanPoints
from wayfi.recordings.simulation.laser import ANGLE_INCREMENT, ANGLE_MIN, BEAMS, ranges
from wayfi.recordings.simulation.surfaces import Surfaces, box, still

HALL = np.concatenate(
    [box(-6.0, -4.0, 9.0, 5.0), box(2.0, -1.0, 2.6, -0.4), box(-3.0, 2.0, -2.0, 2.4), box(5, 1, 6, 3)]
)
TWO_FOLD = np.concatenate([box(-4.0, -3.0, 4.0, 3.0), box(1.0, 1.0, 2.0, 1.5), box(-2.0, -1.5, -1.0, -1.0)])
CORRIDOR = np.array([[-100.0, -1.2, 100.0, -1.2], [-100.0, 1.2, 100.0, 1.2]])
DOOR_M, ROOM_M, ROOMS = 1.0, 4.0, 8


def look_alike() -> Floats:
    """(n, 4) ends of the walls of rooms side by side along a corridor, of which each looks as the next."""
    end = ROOMS * ROOM_M
    faces = [box(-2.0, 0.0, end + 2.0, 2.0)[[1, 2, 3]], [[-2.0, 0.0, 0.0, 0.0], [end, 0.0, end + 2.0, 0.0]]]
    for x in ROOM_M * np.arange(ROOMS):
        before, behind = x + 0.5 * (ROOM_M - DOOR_M), x + 0.5 * (ROOM_M + DOOR_M)
        walls = box(x, -ROOM_M, x + ROOM_M, 0.0)
        faces += [[wall for wall in walls if wall[1] != 0.0 or wall[3] != 0.0]]
        faces += [[[x, 0.0, before, 0.0], [behind, 0.0, x + ROOM_M, 0.0]]]
    return np.concatenate([np.asarray(some, np.float64) for some in faces])


LOOK_ALIKE = look_alike()
LIDAR = LidarConfig(thinning_m=0.08)


def see(faces: Floats, pose: Pose2, rng: np.random.Generator, sigma_m: float = 0.01) -> ScanPoints:
    """What a 270 degree laser at `pose` sees of `faces` (n, 4), in base_link, with noise."""
    exact = ranges(still(faces), pose.array()[None], np.zeros(1))[0]
    seen = np.flatnonzero(np.isfinite(exact))
    bearing = ANGLE_MIN + ANGLE_INCREMENT * np.arange(BEAMS)[seen]
    measured = exact[seen] + sigma_m * rng.standard_normal(len(seen))
    points = measured[:, None] * np.stack([np.cos(bearing), np.sin(bearing)], axis=1)
    return scan_from_points(points, Pose2(), LIDAR)


def see_ahead(faces: Floats, pose: Pose2, seed: int = 0) -> ScanPoints:
    """What a 180 degree laser sees, which looks ahead."""
    scan = see(faces, pose, np.random.default_rng(seed))
    ahead = scan.points[:, 0] > 0.0
    return replace(scan, points=scan.points[ahead], normals=scan.normals[ahead])


def see_near(faces: Floats, pose: Pose2, rng: np.random.Generator, reach_m: float) -> ScanPoints:
    """What a 270 degree laser sees that reaches so far."""
    scan = see(faces, pose, rng)
    near = np.hypot(*scan.points.T) < reach_m
    return replace(scan, points=scan.points[near], normals=scan.normals[near])


def faces_at(surfaces: Surfaces, time_s: float) -> Floats:
    """(m, 4) ends of the faces that exist at `time_s`, where they are then."""
    exists = (surfaces.since_s <= time_s) & (time_s < surfaces.until_s)
    elapsed = np.where(np.isfinite(surfaces.since_s), time_s - surfaces.since_s, 0.0)
    shift: Floats = surfaces.velocity_xy * elapsed[:, None]
    return (surfaces.ends + np.hstack([shift, shift]))[exists]


def distances_m(points: Floats, ends: Floats) -> Floats:
    """(n,) from each of `points` (n, 2) to the nearest of the faces `ends` (m, 4)."""
    start_xy, along = ends[:, :2], ends[:, 2:] - ends[:, :2]
    to = points[:, None] - start_xy
    share = np.clip((to * along).sum(axis=2) / (along**2).sum(axis=1), 0.0, 1.0)
    return np.asarray(np.hypot(*(to - share[..., None] * along).transpose(2, 0, 1)).min(axis=1))


def off_by(rng: np.random.Generator, metres: float, degrees: float) -> Pose2:
    """A displacement of exactly `metres`, turned by exactly `degrees`, in a random direction."""
    direction, sign = rng.uniform(-math.pi, math.pi), rng.choice([-1.0, 1.0])
    return Pose2(metres * math.cos(direction), metres * math.sin(direction), sign * math.radians(degrees))
