"""Writes the measurements of a simulated run as MCAP, and the true trajectory."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from wayfi.frontends.measurements import (
    SECOND_NS,
    LaserScan,
    Measurement,
    Odometry,
    PointCloud,
    Sensor,
    StaticTransforms,
    WifiScan,
)
from wayfi.recordings.files.atomic_files import errors_naming
from wayfi.recordings.files.tum import write_tum
from wayfi.recordings.mcap.writer import McapWriter
from wayfi.recordings.ros.codec import encode
from wayfi.recordings.ros.messages import DEFAULT_TOPICS, TYPE_OF_SENSOR
from wayfi.recordings.ros.topics import Encoding
from wayfi.recordings.simulation.robots.models import Robot
from wayfi.recordings.simulation.run import EPOCH_NS, Run, measurements, start
from wayfi.recordings.simulation.spatial import spatial_measurements
from wayfi.recordings.simulation.worlds.blueprints import World

_SENSOR_OF: dict[type[Measurement], Sensor] = {
    StaticTransforms: Sensor.TF_STATIC,
    Odometry: Sensor.ODOM,
    LaserScan: Sensor.SCAN,
    PointCloud: Sensor.POINTS,
    WifiScan: Sensor.WIFI,
}


def _ignore(fraction: float) -> None:
    """Progress that is not shown."""


@dataclass(frozen=True, slots=True)
class SimulatedRecording:
    """The files of a simulated recording, its length, and the number of messages."""

    recording: Path
    truth: Path
    duration_s: float
    path_length_m: float
    messages: int


def simulate(
    world: World,
    out_dir: Path,
    seed: int = 0,
    minutes: float | None = None,
    progress: Callable[[float], None] = _ignore,
    robot: Robot = Robot.TYPICAL,
    points: bool = False,
) -> SimulatedRecording:
    """Write recording.mcap, and truth.tum with base_link at each odometry stamp, into the folder `out_dir`.

    The drive through `world` is cut after `minutes` (None: full length); `robot` is its error model. With `points`, the
    robot has a 3D LiDAR instead of the planar one. The same arguments give the same bytes. `progress` is called
    with the fraction done, 0 to 1, every simulated second. Raises OSError or RecordingError if `out_dir` cannot be
    written.
    """
    run = start(world, seed, minutes, robot)
    out_dir.mkdir(parents=True, exist_ok=True)
    recording, truth = out_dir / "recording.mcap", out_dir / "truth.tum"
    write_tum(truth, run.truth.stamps_ns, run.truth.poses)
    messages = _write(run, spatial_measurements(run) if points else measurements(run), recording, progress)
    return SimulatedRecording(recording, truth, run.length_ns / SECOND_NS, float(run.truth.path_m()[-1]), messages)


def _write(run: Run, received: Iterator[Measurement], path: Path, progress: Callable[[float], None]) -> int:
    """Write the measurements `received` in `run` to `path`; returns their number."""
    count, next_report_ns = 0, EPOCH_NS
    with errors_naming(path), McapWriter(path) as writer:
        for measurement in received:
            sensor = _SENSOR_OF[type(measurement)]
            writer.write(
                DEFAULT_TOPICS[sensor], TYPE_OF_SENSOR[sensor], Encoding.CDR, measurement.stamp_ns, encode(measurement)
            )
            count += 1
            if measurement.stamp_ns >= next_report_ns:
                progress((measurement.stamp_ns - EPOCH_NS) / run.length_ns)
                next_report_ns += SECOND_NS
    progress(1.0)
    return count
