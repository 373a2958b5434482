"""Algorithm 1 of the paper, a batch method, stage by stage; and the methods that the paper compares it with."""

import time
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass

import numpy as np

from wayfi.backend.pose2 import Floats
from wayfi.recordings.trajectory import Trajectory
from wayfi.service.drive.timing import StageTimer
from wayfi.service.reproduction.batch_graph import optimise
from wayfi.service.reproduction.laser_stages import close_scans, lidar_closures
from wayfi.service.reproduction.messages import Progress
from wayfi.service.reproduction.methods import Method, Stage
from wayfi.service.reproduction.recorded_drive import RecordedDrive
from wayfi.service.reproduction.similarities import Similarities, all_similarities
from wayfi.service.reproduction.similarity_model import distance_closures, learn_model
from wayfi.service.reproduction.wifi_closures import Closures, Pairs, candidate_pairs, sequence_closures

WINDOW, NEIGHBOURS = 80, 2  # the paper's choice of w and k

Bar = Callable[[str], AbstractContextManager[Progress]]

_LIDAR_METHODS = (
    (Method.TENTH, 0.1, Stage.TENTH, Stage.SECOND_OPTIMISATION),
    (Method.TWO_FIFTHS, 0.4, Stage.TWO_FIFTHS, Stage.SECOND_OPTIMISATION_TWO_FIFTHS),
)


@dataclass(frozen=True, slots=True, eq=False)
class WifiStage:
    """The similarities of all fingerprints, the candidate pairs, and the closures for w = 80 and k = 2.

    `pairs_s` is the time (s) that similarities and candidates took.
    """

    similarity: Similarities
    pairs: Pairs
    pairs_s: float
    closures: Closures


@dataclass(frozen=True, slots=True, eq=False)
class Reproduction:
    """The trajectories by method and the seconds by stage. Methods and stages of the laser are missing without one."""

    wifi: WifiStage
    trajectories: dict[Method, Trajectory]
    seconds: dict[Stage, float]


def run_algorithm1(drive: RecordedDrive, bar: Bar) -> Reproduction:
    """Run the paper's stages on `drive`; `bar` opens a progress bar with a title.

    Raises ReproductionError if the drive is too short for the similarity model.
    """
    _compile(drive)
    timer = StageTimer()
    wifi = _wifi_stage(drive, bar, timer)
    with bar("first optimisation"), timer(Stage.FIRST_OPTIMISATION):
        coarse = optimise(drive.poses, [wifi.closures])
    with bar("similarity model"):
        model = learn_model(wifi.similarity, drive.poses, drive.path_m)
        by_model = optimise(drive.poses, [], distance_closures(wifi.pairs, wifi.similarity, model))
    poses = {Method.SIMILARITY_MODEL: by_model, Method.WIFI: coarse}
    if drive.scans:
        poses |= _laser_stages(drive, wifi.closures, coarse, bar, timer)
    trajectories = {method: Trajectory(drive.stamps_ns, values) for method, values in poses.items()}
    report = timer.report()
    seconds = {stage: report[stage]["seconds"] for stage in Stage if stage in report}
    return Reproduction(wifi, {Method.ODOMETRY: drive.odometry, **trajectories}, seconds)


def _compile(drive: RecordedDrive) -> None:
    """Run the functions that numba compiles once, on minimal input, so that compilation is not timed."""
    similarity = all_similarities(drive.readings[:2], _no_progress)
    sequence_closures(np.array([[0, 1]]), similarity, drive.poses[:2], 2, 1)
    two = dict(list(drive.scans.items())[:2])
    if two:
        close_scans(two, np.zeros_like(drive.poses), np.zeros_like(drive.path_m), _no_progress)


def _no_progress(fraction: float) -> None:
    """Progress that is not shown."""


def _wifi_stage(drive: RecordedDrive, bar: Bar, timer: StageTimer) -> WifiStage:
    with bar("similarity of all pairs of fingerprints") as progress, timer(Stage.WIFI_CLOSURES):
        start = time.perf_counter()
        similarity = all_similarities(drive.readings, progress)
        pairs = candidate_pairs(similarity, drive.path_m)
        pairs_s = time.perf_counter() - start
        closures = sequence_closures(pairs, similarity, drive.poses, WINDOW, NEIGHBOURS)
    return WifiStage(similarity, pairs, pairs_s, closures)


def _laser_stages(
    drive: RecordedDrive, wifi: Closures, coarse: Floats, bar: Bar, timer: StageTimer
) -> dict[Method, Floats]:
    """(n, 3) poses by method, from the WiFi closures and their `coarse` trajectory (n, 3)."""
    with bar("scan matching in close proximity") as progress, timer(Stage.CLOSE_SCANS):
        close = close_scans(drive.scans, drive.poses, drive.path_m, progress)
    poses = {Method.CLOSE_SCANS: optimise(drive.poses, [wifi, close])}
    for method, share, search, optimisation in _LIDAR_METHODS:
        with bar(f"LiDAR closures of {share:.0%} of the scans") as progress, timer(search):
            additional = lidar_closures(drive.scans, coarse, drive.path_m, share, progress)
        with bar("second optimisation"), timer(optimisation):
            poses[method] = optimise(drive.poses, [wifi, close, additional])
    return poses
