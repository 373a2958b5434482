"""The streaming service on the same recording, with and without the laser."""

import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wayfi.frontends.events import ClosureJudged, ClosureKind, Verdict
from wayfi.recordings.log import NullLog
from wayfi.recordings.trajectory import Trajectory
from wayfi.service.config import config_of
from wayfi.service.drive.drive import Drive
from wayfi.service.drive.warm_up import warm_up
from wayfi.service.evaluation.trajectory_scores import absolute_error
from wayfi.service.reproduction.messages import Progress, sensor_messages
from wayfi.service.reproduction.sweep_figures import SweepFigures, closure_errors


@dataclass(frozen=True, slots=True, eq=False)
class StreamingRun:
    """The final trajectory, the WiFi closures accepted at the end, and the total time (s), reading included."""

    trajectory: Trajectory
    closures: list[ClosureJudged]
    seconds: float


def run_streaming(recording_path: Path, laser: bool, progress: Progress) -> StreamingRun:
    """Run the streaming service with its defaults on a recording, with the `laser` on or off."""
    config = config_of({"lidar": {"enabled": laser}})
    warm_up()
    start = time.perf_counter()
    drive = Drive(config, None, NullLog())
    for message in sensor_messages(recording_path, progress):
        drive.show(drive.feed(*message))
    result = drive.finish()
    seconds = time.perf_counter() - start
    accepted = [verdict for verdict in drive.counters.verdicts.values() if verdict.verdict is Verdict.ACCEPTED]
    by_wifi = [verdict for verdict in accepted if verdict.kind is ClosureKind.WIFI]
    return StreamingRun(Trajectory(result.stamps_ns, result.final), by_wifi, seconds)


def streaming_figures(run: StreamingRun, truth: Trajectory) -> SweepFigures:
    """The figures of a run for Tables I and II, without a time, because its closures are not timed separately."""
    stamps_ns = np.array([(c.stamp_a_ns, c.stamp_b_ns) for c in run.closures], np.int64).reshape(-1, 2)
    T_a_b = np.array([c.T_a_b.array() for c in run.closures]).reshape(-1, 3)
    claimed = np.array([c.heading_claimed for c in run.closures], np.bool_)
    position_m, orientation_rad = closure_errors(stamps_ns, T_a_b, truth, claimed)
    ate_m = absolute_error(run.trajectory, truth).error.ate_rmse_m
    return SweepFigures(len(run.closures), position_m, orientation_rad, None, ate_m)
