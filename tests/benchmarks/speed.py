"""What a message costs: its CPU time on recordings, its growth along a drive, and the rebuilds of a long graph.

    python tests/benchmarks/speed.py [--without-laser] [RECORDING ...]
    python tests/benchmarks/speed.py --growth

RECORDING is a folder with recording.mcap. Without any, the full simulated car park is replayed, and its time printed
with session.rrd as well. CPU time and its ratios stay comparable on a busy machine; times real time do not.
"""

import argparse
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

from wayfi.backend.graph.backend_config import BackendConfig
from wayfi.backend.graph.factors import BetweenFactor, WheelFactor
from wayfi.backend.graph.pose_graph import PoseGraph
from wayfi.backend.graph.wheel_calibration import WheelMotion
from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.odometry.odometry_config import OdometryConfig, calibration_prior
from wayfi.recordings.log import NullLog
from wayfi.recordings.mcap.recording import open_recording
from wayfi.recordings.simulation.recorder import simulate
from wayfi.recordings.simulation.worlds.blueprints import World
from wayfi.service.config import load_config
from wayfi.service.drive.drive import Drive
from wayfi.service.drive.warm_up import warm_up
from wayfi.service.process.collection import collect_seldom, loaded_objects_left_alone
from wayfi.service.replay.replayers import PlainReplayer

MADE = Path(__file__).resolve().parents[2] / "build" / "benchmarks" / "rough" / "carpark"
SLOW_MS = 100.0
MOST_SHOWN = 5  # slow messages of a recording
LAP = 400  # keyframes of the long drive's laps
KEYFRAMES, WINDOW = (1_000, 10_000), 500  # where its updates are compared, over so many of them
STEP = Pose2(0.5, 0.0, 2 * np.pi / LAP)
STEP_COVARIANCE = np.diag([1e-4, 1e-4, 1e-5])


def cpu_of_messages(folder: Path, settings: list[str]) -> tuple[Floats, list[str]]:
    """(n,) ms of CPU of each message, log and files left out, and a line for each message that was slow."""
    drive = Drive(load_config([], settings), None, NullLog())
    replayer = PlainReplayer(drive)
    spent, slow = [], []
    with loaded_objects_left_alone():
        for record in open_recording(folder / "recording.mcap"):
            drive.timer.pop_durations()
            start = time.process_time()
            replayer.play(record)
            spent.append(1e3 * (time.process_time() - start))
            if spent[-1] > SLOW_MS:
                stages = {name: round(1e3 * s) for name, s in drive.timer.pop_durations().items() if s > 0.01}
                slow.append(f"    message {len(spent)}: {spent[-1]:.0f} ms; wall time of its stages: {stages}")
    return np.array(spent), slow


def report(folder: Path, settings: list[str]) -> None:
    """Print what the messages of a recording cost."""
    spent, slow = cpu_of_messages(folder, settings)
    tenths = [part.mean() for part in np.array_split(spent, 10)]
    p50, p99 = np.percentile(spent, [50, 99])
    say(
        f"{folder.name}: {len(spent)} messages, {spent.sum() / 1e3:.1f} s of CPU; ms p50 {p50:.3f}, p99 {p99:.2f}, "
        f"max {spent.max():.0f}; over {SLOW_MS:.0f} ms: {len(slow)}; last tenth / first: {tenths[-1] / tenths[0]:.2f}"
    )
    for line in slow[:MOST_SHOWN]:
        say(line)


def replay_with_rrd(folder: Path) -> None:
    """Print how many times real time a whole replay takes, with session.rrd and all files."""
    with tempfile.TemporaryDirectory() as out:
        command = [sys.executable, "-m", "wayfi.service.cli", "replay", str(folder / "recording.mcap"), "--out", out]
        start = time.perf_counter()
        done = subprocess.run([*command, "--json"], capture_output=True, text=True, check=True)
        wall_s = time.perf_counter() - start
        say(f"{folder.name}: {json.loads(done.stdout)['recording_s'] / wall_s:.0f} times real time, .rrd and all")


def growth() -> None:
    """Print what an update and a covariance cost at 1,000 keyframes and at 10,000, and a rebuild of the latter."""
    for name, lap in (("with a closure every 20 keyframes", LAP), ("without closures", 0)):
        graph, update_ms, covariance_ms = long_drive(max(KEYFRAMES), lap)
        for what, spent in (("an update", update_ms), ("a covariance between keyframes", covariance_ms)):
            early, late = (float(np.median(spent[n - WINDOW : n])) for n in KEYFRAMES)
            say(f"{what}, {name}: ms p50 at {KEYFRAMES}: {early:.3f}, {late:.3f}; ratio {late / early:.2f}")
        say(f"    longest update {update_ms.max():.0f} ms")
    restart_cost(graph)


def long_drive(keyframes: int, lap: int) -> tuple[PoseGraph, Floats, Floats]:
    """A graph of laps, and ms of CPU of each update and of a covariance that far back; `lap` 0 closes no loop."""
    graph = PoseGraph(BackendConfig(), calibration_prior(OdometryConfig()))
    graph.add_keyframe(Pose2())
    update_ms, covariance_ms = np.zeros(keyframes), np.full(keyframes, np.nan)
    motion = WheelMotion(STEP, STEP.x, STEP.x)
    for k in range(1, keyframes):
        graph.add_keyframe(graph.pose(k - 1) @ STEP)
        graph.add(WheelFactor(k - 1, k, motion, 4 * STEP_COVARIANCE))
        graph.add(BetweenFactor(k - 1, k, STEP, STEP_COVARIANCE))
        if lap and k > lap and k % 20 == 0:
            graph.add(BetweenFactor(k - lap, k, Pose2(), 4 * STEP_COVARIANCE))
        update_ms[k] = cpu_ms(graph.update)
        if k % 20 == 10:
            covariance_ms[k - 10 : k + 10] = cpu_ms(partial(graph.relative_covariance, max(k - LAP, 0), k))
    return graph, update_ms, covariance_ms


def restart_cost(graph: PoseGraph) -> None:
    """Print what a restart costs in all, in how many updates, and at most in one."""
    off = graph.poses() + np.random.default_rng(0).normal(0, [0.1, 0.1, 0.01], (graph.keyframes, 3))
    graph.restart(graph.calibrations(), off)
    spent = [cpu_ms(graph.update)]
    while graph.restarts:
        spent.append(cpu_ms(graph.update))
    say(f"a restart at {graph.keyframes}: ms {sum(spent):.0f} in {len(spent)} updates, at most {max(spent):.0f}")


def cpu_ms(call: Callable[[], object]) -> float:
    """CPU ms of a call."""
    start = time.process_time()
    call()
    return 1e3 * (time.process_time() - start)


def say(line: str) -> None:
    """Show a line at once."""
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description="What a message costs.")
    parser.add_argument("recordings", nargs="*", type=Path, help="folders with recording.mcap")
    parser.add_argument("--without-laser", action="store_true", help="switch the laser off")
    parser.add_argument("--growth", action="store_true", help="only the synthetic long drive")
    arguments = parser.parse_args()
    if arguments.growth:
        growth()
        return
    if not arguments.recordings and not MADE.exists():
        simulate(World.CARPARK, MADE)
    collect_seldom()
    warm_up()
    for folder in arguments.recordings or [MADE]:
        report(folder, ["lidar.enabled=false"] if arguments.without_laser else [])
    if not arguments.recordings:
        replay_with_rrd(MADE)
        growth()


if __name__ == "__main__":
    main()
