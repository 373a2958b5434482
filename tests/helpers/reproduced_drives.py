"""Small drives with known truth, and what is heard on them, for the tests of the batch method."""

import numpy as np

from wayfi.backend.pose2 import Floats, between_all, compose_all, wrap
from wayfi.frontends.measurements import SECOND_NS
from wayfi.frontends.wifi.readings import Readings
from wayfi.recordings.trajectory import Trajectory
from wayfi.service.reproduction.similarities import Similarities


def silent(fraction: float) -> None:
    pass


def readings(rssi_dbm: Floats, least_dbm: float = -90.0) -> Readings:
    """A scan that hears access point i at `rssi_dbm[i]`, if that is strong enough."""
    heard = np.flatnonzero(rssi_dbm >= least_dbm)
    bssids = tuple(f"02:00:00:00:00:{i:02x}" for i in heard)
    return Readings(bssids, rssi_dbm[heard].astype(np.float32), np.zeros(len(heard), np.float32))


def radio(places: Floats) -> list[Readings]:
    """What is heard at (n, 2) m places of 40 access points that fade evenly with distance."""
    points = np.random.default_rng(0).uniform(-10, 35, (40, 2))
    distance = np.hypot(*(places[:, None] - points[None]).transpose(2, 0, 1))
    return [readings(row) for row in -35.0 - 30.0 * np.log10(1.0 + distance)]


def ring(laps: float, step_m: float = 0.5) -> Floats:
    """(n, 3) poses on a rectangle of 24 x 12 m, 72 m around."""
    s = np.arange(0.0, laps * 72.0, step_m) % 72.0
    ends_m, turns = [0.0, 24.0, 36.0, 60.0, 72.0], [0.0, 0.5, 1.0, 1.5]
    x = np.interp(s, ends_m, [0.0, 24.0, 24.0, 0.0, 0.0])
    y = np.interp(s, ends_m, [0.0, 0.0, 12.0, 12.0, 0.0])
    side = np.clip(np.searchsorted(ends_m, s, side="right") - 1, 0, 3)
    return np.stack([x, y, np.array([wrap(turns[i] * np.pi) for i in side])], axis=1)


def drifting(poses: Floats, turn_rad_per_step: float) -> Floats:
    """What wheels make of `poses` that turn by themselves."""
    steps = between_all(poses[:-1], poses[1:]) + np.array([0.0, 0.0, turn_rad_per_step])
    drifted = [poses[0]]
    for step in steps:
        drifted.append(compose_all(drifted[-1], step)[0])
    return np.array(drifted)


def path_of(poses: Floats) -> Floats:
    return Trajectory(np.arange(len(poses)), poses).path_m()


def alike(places_a: Floats, places_b: Floats, reach_m: float = 1.5) -> Similarities:
    """(n, m) similarity that fades with the distance of the true places."""
    distance2 = ((places_a[:, None, :2] - places_b[None, :, :2]) ** 2).sum(axis=2)
    return np.exp(-0.5 * distance2 / reach_m**2).astype(np.float32)


def trajectory(poses: Floats) -> Trajectory:
    return Trajectory(np.arange(len(poses), dtype=np.int64) * SECOND_NS, poses)
