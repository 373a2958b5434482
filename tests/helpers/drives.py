"""Drives for whole replays: simulated measurements, changed at will, written as a recording, replayed and scored."""

import dataclasses
import json
import math
import os
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.measurements import (
    InitialPose,
    LaserScan,
    Measurement,
    MovingTransforms,
    Odometry,
    PointCloud,
    PoseFix,
    Sensor,
    StaticTransforms,
    WifiScan,
)
from wayfi.recordings.files.tum import read_tum
from wayfi.recordings.mcap.writer import McapWriter
from wayfi.recordings.ros.codec import encode
from wayfi.recordings.ros.messages import DEFAULT_TOPICS, TYPE_OF_SENSOR
from wayfi.recordings.ros.topics import Encoding
from wayfi.recordings.simulation.recorder import SimulatedRecording
from wayfi.recordings.simulation.run import EPOCH_NS, Run, measurements, start
from wayfi.recordings.simulation.worlds.blueprints import World
from wayfi.recordings.trajectory import Trajectory
from wayfi.service.config import load_config
from wayfi.service.evaluation.trajectory_scores import absolute_error
from wayfi.service.replay.replay import ReplayOptions, replay

RESULT_FILES = (
    *("trajectory.tum", "online.tum", "session.rrd", "closures.csv", "map.pgm", "map.yaml", "map.png", "graph.g2o"),
    *("radio.csv", "report.json", "config.toml", "calibration.toml"),
)
_SENSOR_OF: dict[type[Measurement], Sensor] = {
    Odometry: Sensor.ODOM,
    LaserScan: Sensor.SCAN,
    PointCloud: Sensor.POINTS,
    WifiScan: Sensor.WIFI,
    StaticTransforms: Sensor.TF_STATIC,
    MovingTransforms: Sensor.TF,
    PoseFix: Sensor.FIX,
    InitialPose: Sensor.INITIAL_POSE,
}


@dataclass(frozen=True, slots=True, eq=False)
class Arrival:
    """A measurement and when it came in, ns; `data` takes the place of what it would be encoded to."""

    at_ns: int
    measurement: Measurement
    encoding: str = Encoding.CDR
    data: bytes | None = None

    @property
    def second(self) -> float:
        """When it came in, s into the drive."""
        return (self.at_ns - EPOCH_NS) * 1e-9

    def stamped(self, shift_s: float) -> "Arrival":
        """The same arrival, its stamp moved."""
        moved: Any = dataclasses.replace(self.measurement, stamp_ns=self.measurement.stamp_ns + round(shift_s * 1e9))
        return replace(self, measurement=moved)

    def delayed(self, seconds: float) -> "Arrival":
        """The same measurement, come in later."""
        return replace(self, at_ns=self.at_ns + round(seconds * 1e9))


@dataclass(frozen=True, slots=True, eq=False)
class Simulated:
    """A simulated drive as it came in, and the truth of it."""

    arrivals: tuple[Arrival, ...]
    truth: Trajectory

    def count(self, kind: type[Measurement]) -> int:
        """How many measurements of `kind` there are."""
        return sum(isinstance(a.measurement, kind) for a in self.arrivals)

    def without(self, *kinds: type[Measurement]) -> list[Arrival]:
        """The arrivals of all other kinds."""
        return [a for a in self.arrivals if not isinstance(a.measurement, kinds)]


def simulated(world: World, minutes: float, seed: int = 0) -> Simulated:
    """The first `minutes` of a drive through `world`."""
    run = start(world, seed, minutes)
    return Simulated(tuple(Arrival(m.stamp_ns, m) for m in measurements(run)), run.truth)


@cache
def whole_run(world: World, seed: int) -> Run:
    """The whole run of the typical robot, made once; not to be changed."""
    return start(world, seed)


def circling(messages: int) -> Iterator[Arrival]:
    """Odometry alone, at 100 Hz on a circle."""
    for number in range(messages):
        at_ns, angle = EPOCH_NS + number * 10_000_000, number * 1e-3
        pose = Pose2(5 * math.sin(angle), 5 - 5 * math.cos(angle), angle)
        yield Arrival(at_ns, Odometry(at_ns, pose))


def change(
    arrivals: Iterable[Arrival], kind: type[Measurement], numbers: Sequence[int], how: Callable[[Any], Arrival]
) -> list[Arrival]:
    """`arrivals` with the given ones of `kind`, counted from 0, replaced by what `how` makes of them."""
    out, number = [], 0
    for arrival in arrivals:
        if isinstance(arrival.measurement, kind):
            arrival, number = (how(arrival) if number in numbers else arrival), number + 1
        out.append(arrival)
    return out


def write(path: Path, arrivals: Iterable[Arrival], flush_every: int = 500) -> Path:
    """Write the arrivals, in the order of their coming in, to the MCAP file `path`."""
    with McapWriter(path) as writer:
        for number, a in enumerate(sorted(arrivals, key=lambda a: a.at_ns)):
            sensor = _SENSOR_OF[type(a.measurement)]
            encoding = Encoding.JSON if a.encoding == Encoding.JSON else Encoding.CDR
            data = encode(a.measurement, encoding) if a.data is None else a.data
            writer.write(DEFAULT_TOPICS[sensor], TYPE_OF_SENSOR[sensor], a.encoding, a.at_ns, data)
            if number % flush_every == flush_every - 1:
                writer.flush()
    return path


def run(recording: Path, out: Path, *settings: str, rrd: bool = False, rate: float | None = None) -> dict[str, Any]:
    """Replay in this process; the report."""
    return replay(recording, load_config((), settings), None, ReplayOptions(out, rate, rrd))


def cli(*arguments: str | Path) -> "subprocess.CompletedProcess[str]":
    """`wayfi` with these arguments, in a process of its own."""
    command = [sys.executable, "-m", "wayfi.service.cli", *map(str, arguments)]
    environment = {**os.environ, "RERUN_ANALYTICS": "0", "COLUMNS": "200"}
    return subprocess.run(command, capture_output=True, text=True, env=environment, timeout=500, check=False)


@dataclass(frozen=True, slots=True)
class Replayed:
    """A recording, the folder of its replay, and the report."""

    simulated: SimulatedRecording
    out: Path
    report: dict[str, Any]


def replay_by_cli(recording: Path, out: Path, *options: str | Path) -> dict[str, Any]:
    """Replay in a process of its own; the report."""
    done = cli("replay", recording, "--out", out, "--json", *options)
    assert done.returncode == 0, done.stderr
    report: dict[str, Any] = json.loads(done.stdout)
    return report


def lines(path: Path) -> list[str]:
    """The lines of a text file."""
    return path.read_text().splitlines()


def ate_m(out: Path, truth: Trajectory, name: str = "trajectory.tum") -> float:
    """ATE RMSE, m, of a replay's trajectory; all of the truth has to be covered."""
    error = absolute_error(read_tum(out / name), truth).error
    assert error.not_covered == 0
    return error.ate_rmse_m
