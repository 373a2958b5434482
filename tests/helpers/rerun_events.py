"""The events of an imagined drive: laps around the aisles of a car park, with drift, closures and corrections."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.graph.health import State
from wayfi.backend.pose2 import Floats, Pose2, between_all, compose_all
from wayfi.frontends.events import (
    CalibrationUpdated,
    CheckDone,
    ClosureJudged,
    ClosureKind,
    Dropped,
    DropReason,
    Event,
    FingerprintAdded,
    GraphUpdated,
    GridRedrawn,
    KeyframeAdded,
    PosePublished,
    SequenceMatched,
    StateChanged,
    SubmapMatched,
    Verdict,
    Warned,
)
from wayfi.frontends.measurements import Sensor

LONG_M, WIDE_M, LANE_M = 60.0, 24.0, 5.0
STEP_M, POSES_A_KEYFRAME, KEYFRAMES_A_LAP = 0.4, 10, 340
START_NS = 1_700_000_000_000_000_000
POSE_NS = 96_000_000


def truth(keyframes: int) -> Floats:
    """(n, 3) poses around a rectangle, a keyframe every STEP_M, each lap in a lane of its own."""
    poses = np.zeros((keyframes, 3))
    for k in range(keyframes):
        lap, inset = divmod(k, KEYFRAMES_A_LAP)[0], 0.6 * (divmod(k, KEYFRAMES_A_LAP)[0] % 4)
        long, wide = LONG_M - 2 * inset, WIDE_M - 2 * inset
        s = (k - lap * KEYFRAMES_A_LAP) / KEYFRAMES_A_LAP * 2 * (long + wide)
        poses[k] = _on_rectangle(s, long, wide, inset)
    return poses


def _on_rectangle(s: float, long: float, wide: float, inset: float) -> tuple[float, float, float]:
    if s < long:
        return inset + s, inset, 0.0
    if s < long + wide:
        return inset + long, inset + s - long, np.pi / 2
    if s < 2 * long + wide:
        return inset + long - (s - long - wide), inset + wide, -np.pi
    return inset, inset + wide - (s - 2 * long - wide), -np.pi / 2


def walls() -> Floats:
    """(n, 2) points on the outer walls and on the pillars between the lanes."""
    low, high_x, high_y = -LANE_M, LONG_M + LANE_M, WIDE_M + LANE_M
    x, y = np.arange(low, high_x, 0.05), np.arange(low, high_y, 0.05)
    sides = [np.stack([x, np.full_like(x, v)], 1) for v in (low, high_y)]
    sides += [np.stack([np.full_like(y, v), y], 1) for v in (low, high_x)]
    edge = np.arange(-0.3, 0.3, 0.05)
    box = np.concatenate(
        [np.stack([edge, np.full_like(edge, v)], 1) for v in (-0.3, 0.3)]
        + [np.stack([np.full_like(edge, v), edge], 1) for v in (-0.3, 0.3)]
    )
    pillars = [box + np.array([px, py]) for px in np.arange(5, LONG_M - 4, 7.5) for py in (5.0, WIDE_M - 5.0)]
    return np.concatenate(sides + pillars)


@dataclass
class _Drive:
    keyframes: int
    beams: int
    rng: np.random.Generator
    true: Floats
    odometry: Floats
    walls: Floats
    place_of_fingerprint: list[int]


def drive(keyframes: int, beams: int = 400, seed: int = 1) -> Iterator[Event]:
    """Ten poses and a fingerprint a keyframe; from the second lap on a candidate every third keyframe."""
    rng = np.random.default_rng(seed)
    true = truth(keyframes)
    steps = between_all(true[:-1], true[1:]) + rng.normal(0, [0.004, 0.001, 0.0006], (keyframes - 1, 3))
    steps[:, 2] += 0.0007
    odometry = np.zeros((keyframes, 3))
    for k in range(1, keyframes):
        odometry[k] = compose_all(odometry[k - 1], steps[k - 1])[0]
    state = _Drive(keyframes, beams, rng, true, odometry, walls(), [])
    yield StateChanged(START_NS, State.TRACKING, "first pose")
    yield from _events(state)


def _events(d: _Drive) -> Iterator[Event]:
    believed = np.zeros((0, 3))
    closure, factors = 0, 0
    for k in range(d.keyframes):
        stamp = START_NS + k * POSES_A_KEYFRAME * POSE_NS
        T_map_odom = _map_odom(believed, d.odometry)
        believed = np.vstack([believed, compose_all(T_map_odom.array(), d.odometry[k])])
        yield from _poses(d, k, stamp, T_map_odom)
        scan = _scan(d, d.true[k])
        T = Pose2.of(believed[k])
        yield KeyframeAdded(k, stamp, T, scan, 0.9 if k else float("nan"))
        if k:
            near = np.concatenate(
                [Pose2.of(believed[j]).transform(_scan(d, d.true[j])) for j in range(max(0, k - 3), k)]
            )
            yield SubmapMatched(stamp, k, near, T, 0.9)
        factors += 1
        yield GraphUpdated(stamp, k, None, 1, 0, factors, 0.02 * factors)
        yield from _fingerprint(d, k, stamp)
        if k >= KEYFRAMES_A_LAP and k % 3 == 0:
            verdict = (Verdict.ACCEPTED, Verdict.REFUSED, Verdict.REFUSED)[(k // 3) % 3]
            a = k - KEYFRAMES_A_LAP if verdict is Verdict.ACCEPTED else (k * 7919) % (k - 200)
            yield from _candidate(d, believed, closure, a, k, stamp, verdict)
            if verdict is Verdict.ACCEPTED:
                believed = _corrected(believed, d.true, k)
                factors += 1
                yield GraphUpdated(stamp, k, believed.copy(), 1, 0, factors, 0.02 * factors + 1.0)
            if verdict is Verdict.ACCEPTED and closure % 30 == 9:
                yield _judged(closure, a, k, Verdict.REMOVED, "inconsistent with later closures", d)
                factors -= 1
                yield GraphUpdated(stamp, k, None, 0, 1, factors, 0.02 * factors)
            closure += 1
        if k % 30 == 29:
            yield _grid(d, stamp, k)
            yield CalibrationUpdated(stamp, np.array([1.0, 1.0, 0.0007, 0.0]), np.full(4, 1e-4))
        if k % 100 == 50:
            yield Dropped(Sensor.ODOM, stamp, DropReason.DUPLICATE)
    yield Warned(stamp, "the drive is over")


def _map_odom(believed: Floats, odometry: Floats) -> Pose2:
    if not len(believed):
        return Pose2()
    return Pose2.of(believed[-1]) @ Pose2.of(odometry[len(believed) - 1]).inverse()


def _corrected(believed: Floats, true: Floats, k: int) -> Floats:
    """Most of the error goes: all along the drive in the first corrections, hardly anything moves in later ones."""
    error = true[: k + 1] - believed
    error[:, 2] = (error[:, 2] + np.pi) % (2 * np.pi) - np.pi
    return believed + 0.9 * error


def _poses(d: _Drive, k: int, stamp: int, T_map_odom: Pose2) -> Iterator[Event]:
    previous, newest = Pose2.of(d.odometry[max(k - 1, 0)]), Pose2.of(d.odometry[k])
    spread = 0.05 + 0.9 * ((k % KEYFRAMES_A_LAP) / KEYFRAMES_A_LAP if k < KEYFRAMES_A_LAP else 0.1)
    covariance = np.diag([spread**2, (0.4 * spread) ** 2, 0.01**2])
    for i in range(1, POSES_A_KEYFRAME + 1):
        T_odom_base = previous.interpolate(newest, i / POSES_A_KEYFRAME)
        yield PosePublished(
            stamp + (i - POSES_A_KEYFRAME) * POSE_NS, T_map_odom @ T_odom_base, T_map_odom, T_odom_base, covariance,
            State.TRACKING,
        )  # fmt: skip


def _scan(d: _Drive, pose: Floats) -> NDArray[np.float32]:
    local = Pose2.of(pose).inverse().transform(d.walls)
    seen = local[np.hypot(*local.T) < 25]
    picked = seen[np.linspace(0, len(seen) - 1, min(d.beams, len(seen))).astype(int)]
    return (picked + d.rng.normal(0, 0.01, picked.shape)).astype(np.float32)


def _fingerprint(d: _Drive, k: int, stamp: int) -> Iterator[Event]:
    number = len(d.place_of_fingerprint)
    d.place_of_fingerprint.append(k)
    earlier = np.arange(number)
    away = np.hypot(*(d.true[d.place_of_fingerprint[:-1], :2] - d.true[k, :2]).T)
    similarity = np.exp(-((away / 6) ** 2)) * 0.8 + 0.1 * d.rng.random(number)
    aps = np.argsort((np.arange(120) * 0.5 - d.true[k, 0]) ** 2 + (np.arange(120) % 7 * 4 - d.true[k, 1]) ** 2)[:44]
    rssi = (-40 - 1.2 * np.arange(44) + d.rng.normal(0, 3, 44)).astype(np.float32)
    bssids = tuple(f"02:00:00:00:00:{ap:02x}" for ap in aps)
    yield FingerprintAdded(number, stamp, "phone", k, Pose2(0.1, 0, 0), bssids, rssi, earlier, similarity)


def _candidate(
    d: _Drive, believed: Floats, closure: int, a: int, b: int, stamp: int, verdict: Verdict
) -> Iterator[Event]:
    first, second = believed[max(0, a - 40) : a + 40 : 2, :2], believed[max(0, b - 80) : b + 1 : 2, :2]
    n = min(len(first), len(second))
    yield SequenceMatched(stamp, a, b, first[:n], second[:n], 0.8)
    T_a_b = Pose2.of(d.true[a]).between(Pose2.of(d.true[b]))
    guess = T_a_b @ Pose2(0.6, -0.4, 0.12)
    ratio = 0.85 if verdict is Verdict.ACCEPTED else 0.3
    yield CheckDone(stamp, a, b, _scan(d, d.true[b]), _scan(d, d.true[a]), guess, T_a_b, ratio, 0.4)
    reason = "lidar check passed" if verdict is Verdict.ACCEPTED else "inlier ratio below 0.5"
    yield _judged(closure, a, b, verdict, reason, d)


def _judged(closure: int, a: int, b: int, verdict: Verdict, reason: str, d: _Drive) -> ClosureJudged:
    def stamp(k: int) -> int:
        return START_NS + k * POSES_A_KEYFRAME * POSE_NS

    T_a_b = Pose2.of(d.true[a]).between(Pose2.of(d.true[b]))
    ratio = 0.3 if verdict is Verdict.REFUSED else 0.85
    return ClosureJudged(
        closure, stamp(a), stamp(b), a, b, ClosureKind.LIDAR, "wifi", 0.6, 0.8, ratio, T_a_b, np.eye(3) * 1e-3, True,
        verdict, reason,
    )  # fmt: skip


def _grid(d: _Drive, stamp: int, k: int) -> GridRedrawn:
    size, origin = 0.1, (-LANE_M - 2, -LANE_M - 2)
    shape = (round((WIDE_M + 2 * LANE_M + 4) / size), round((LONG_M + 2 * LANE_M + 4) / size))
    occupancy = np.full(shape, 0.5, np.float32)
    rows, columns = np.mgrid[: shape[0], : shape[1]]
    x, y = columns * size + origin[0], rows * size + origin[1]
    inside = (x > -LANE_M) & (x < LONG_M + LANE_M) & (y > -LANE_M) & (y < WIDE_M + LANE_M)
    for pose in d.true[: k + 1 : 15]:
        occupancy[inside & (np.hypot(x - pose[0], y - pose[1]) < 12)] = 0.1
    index = np.floor((d.walls - origin) / size).astype(int)
    near = np.min(np.hypot(*(d.walls[:, None] - d.true[None, : k + 1 : 15, :2]).transpose(2, 0, 1)), axis=1) < 14
    occupancy[index[near, 1], index[near, 0]] = 0.95
    return GridRedrawn(stamp, occupancy, size, origin)
