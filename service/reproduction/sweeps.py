"""Tables I and II: Algorithm 1 up to its first optimisation, for other values of w and k."""

import time

from wayfi.recordings.trajectory import Trajectory
from wayfi.service.evaluation.trajectory_scores import absolute_error
from wayfi.service.reproduction import paper_figures
from wayfi.service.reproduction.algorithm1 import NEIGHBOURS, WINDOW, WifiStage
from wayfi.service.reproduction.batch_graph import optimise
from wayfi.service.reproduction.messages import Progress
from wayfi.service.reproduction.recorded_drive import RecordedDrive
from wayfi.service.reproduction.sweep_figures import SweepFigures, closure_errors
from wayfi.service.reproduction.wifi_closures import sequence_closures

Sweep = dict[int, SweepFigures]


def run_sweeps(drive: RecordedDrive, wifi: WifiStage, truth: Trajectory, progress: Progress) -> tuple[Sweep, Sweep]:
    """The figures by w (k = 2) and by k (w = 80), for the values in the paper."""
    windows, neighbours = paper_figures.WINDOWS, paper_figures.NEIGHBOURS
    settings = sorted({(w, NEIGHBOURS) for w in windows} | {(WINDOW, k) for k in neighbours})
    figures = {}
    for number, setting in enumerate(settings, 1):
        figures[setting] = _figures(drive, wifi, truth, *setting)
        progress(number / len(settings))
    return {w: figures[w, NEIGHBOURS] for w in windows}, {k: figures[WINDOW, k] for k in neighbours}


def _figures(drive: RecordedDrive, wifi: WifiStage, truth: Trajectory, window: int, neighbours: int) -> SweepFigures:
    """The figures for one w and k; the time includes that of the similarities, which depend on neither."""
    start = time.perf_counter()
    closures = sequence_closures(wifi.pairs, wifi.similarity, drive.poses, window, neighbours)
    seconds = wifi.pairs_s + time.perf_counter() - start
    position_m, orientation_rad = closure_errors(drive.stamps_ns[closures.pairs], closures.T_a_b, truth)
    estimate = Trajectory(drive.stamps_ns, optimise(drive.poses, [closures]))
    ate_m = absolute_error(estimate, truth).error.ate_rmse_m
    return SweepFigures(len(closures), position_m, orientation_rad, seconds, ate_m)
