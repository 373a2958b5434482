"""Laps of an oval with known truth, estimates of it and closures between them, for the tests of the evaluation."""

import math
from pathlib import Path

import numpy as np

from wayfi.backend.pose2 import Floats, Pose2, between_all, compose_all
from wayfi.frontends.events import ClosureJudged, ClosureKind, Verdict
from wayfi.recordings.files.tables import ClosureRow, read_closures, write_closures
from wayfi.recordings.files.tum import write_tum
from wayfi.recordings.trajectory import Trajectory

START_NS = 1_700_000_000_000_000_000


def loops(count: int = 1200, laps: float = 3.0) -> Trajectory:
    """Laps of a 30 x 12 m oval (70 m each), a pose each half second."""
    angle = np.linspace(0, 2 * math.pi * laps, count)
    xy = np.c_[15 * np.cos(angle), 6 * np.sin(angle)]
    heading = np.arctan2(6 * np.cos(angle), -15 * np.sin(angle))
    stamps_ns = START_NS + np.arange(count, dtype=np.int64) * 500_000_000
    return Trajectory(stamps_ns, np.c_[xy, heading])


def moved(trajectory: Trajectory, T: Floats) -> Trajectory:
    return Trajectory(trajectory.stamps_ns, compose_all(T, trajectory.poses))


def noisy(trajectory: Trajectory, sigma_m: float, seed: int = 0) -> Trajectory:
    noise = np.random.default_rng(seed).normal(0, [sigma_m, sigma_m, sigma_m / 5], trajectory.poses.shape)
    return Trajectory(trajectory.stamps_ns, trajectory.poses + noise)


def closures_of(
    truth: Trajectory, kind: ClosureKind, sigma: tuple[float, float, float], count: int = 60, lap: int = 400
) -> list[ClosureJudged]:
    """Closures between places one lap apart, with errors drawn from the covariance that they claim."""
    rng = np.random.default_rng(3)
    a = np.linspace(0, len(truth) - lap - 1, count).astype(int)
    T_a_b = between_all(truth.poses[a], truth.poses[a + lap]) + rng.normal(0, sigma, (count, 3))
    return [
        ClosureJudged(
            closure=k,
            stamp_a_ns=int(truth.stamps_ns[i]),
            stamp_b_ns=int(truth.stamps_ns[i + lap]),
            keyframe_a=int(i),
            keyframe_b=int(i + lap),
            kind=kind,
            proposed_by="wifi",
            similarity=0.5,
            residual_m=0.1,
            inlier_ratio=0.9,
            T_a_b=Pose2.of(T_a_b[k]),
            covariance=np.diag(np.square(sigma)),
            heading_claimed=kind is ClosureKind.LIDAR,
            verdict=Verdict.ACCEPTED,
            reason="",
        )
        for k, i in enumerate(a)
    ]


def rows_of(tmp_path: Path, judged: list[ClosureJudged]) -> list[ClosureRow]:
    write_closures(tmp_path / "closures.csv", judged)
    return read_closures(tmp_path / "closures.csv")


def replay_folder(folder: Path, truth: Trajectory, final: Trajectory, online: Trajectory) -> Path:
    folder.mkdir(exist_ok=True)
    write_tum(folder / "truth.tum", truth.stamps_ns, truth.poses)
    write_tum(folder / "trajectory.tum", final.stamps_ns, final.poses)
    write_tum(folder / "online.tum", online.stamps_ns, online.poses)
    write_closures(folder / "closures.csv", closures_of(truth, ClosureKind.LIDAR, (0.05, 0.05, 0.01)))
    return folder
