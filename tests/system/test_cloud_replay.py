"""Whole drives with a 3D LiDAR in place of the planar one: with wheels and without, with times and without."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from drives import Arrival, ate_m, cli, lines, run, write

from wayfi.frontends.measurements import LaserScan, Odometry, PointCloud, StaticTransforms, WifiScan
from wayfi.recordings.files.tum import read_tum
from wayfi.recordings.simulation.run import measurements, start
from wayfi.recordings.simulation.spatial import spatial_measurements
from wayfi.recordings.simulation.worlds.blueprints import World
from wayfi.recordings.trajectory import Trajectory
from wayfi.service.evaluation.trajectory_scores import absolute_error

SECONDS = 45


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Drive:
    """What a robot with a 3D LiDAR receives, its truth, and the scans of a planar laser on the same way."""

    arrivals: list[Arrival]
    scans: list[Arrival]
    truth: Trajectory

    def without(self, *kinds: type) -> list[Arrival]:
        return [a for a in self.arrivals if not isinstance(a.measurement, kinds)]


@pytest.fixture(scope="module")
def drive() -> Drive:
    simulated = start(World.CARPARK, 0, SECONDS / 60)
    arrivals = [Arrival(_complete_ns(m), m) for m in spatial_measurements(simulated)]
    scans = [Arrival(m.stamp_ns, m) for m in measurements(simulated) if isinstance(m, LaserScan)]
    return Drive(arrivals, scans, simulated.truth)


def _complete_ns(measurement: Any) -> int:  # noqa: ANN401 - any measurement
    """A cloud comes in when its turn is complete."""
    return measurement.stamp_ns + (100_000_000 if isinstance(measurement, PointCloud) else 0)


def replayed(tmp_path: Path, arrivals: Sequence[Arrival], *settings: str) -> tuple[dict[str, Any], Path]:
    report = run(write(tmp_path / "recording.mcap", arrivals), tmp_path / "out", *settings)
    return report, tmp_path / "out"


def changed(arrivals: Sequence[Arrival], **values: Any) -> list[Arrival]:  # noqa: ANN401 - any field
    """The arrivals, every cloud with these fields."""
    return [
        dataclasses.replace(a, measurement=dataclasses.replace(a.measurement, **values))
        if isinstance(a.measurement, PointCloud)
        else a
        for a in arrivals
    ]


def test_a_drive_with_clouds_is_known_to_centimetres(drive: Drive, tmp_path: Path) -> None:
    report, out = replayed(tmp_path, drive.arrivals)
    assert report["dropped"] == {}
    assert ate_m(out, drive.truth) < 0.04
    assert ate_m(out, drive.truth, "online.tum") < 0.06
    walls = np.frombuffer((out / "map.pgm").read_bytes().split(b"255\n", 1)[1], np.uint8) == 0
    assert walls.sum() > 500


def test_clouds_without_times_are_taken_as_of_one_instant(drive: Drive, tmp_path: Path) -> None:
    _, out = replayed(tmp_path, changed(drive.arrivals, time_s=None))
    assert ate_m(out, drive.truth) < 0.1


def test_clouds_lead_where_there_is_no_odometry(drive: Drive, tmp_path: Path) -> None:
    report, out = replayed(tmp_path, drive.without(Odometry, WifiScan))
    assert report["warnings"] == ["no odometry: the laser leads"]
    clouds = sum(isinstance(a.measurement, PointCloud) for a in drive.arrivals)
    assert len(lines(out / "trajectory.tum")) == pytest.approx(clouds, abs=2)
    assert absolute_error(read_tum(out / "trajectory.tum"), drive.truth).error.ate_rmse_m < 0.06


def test_the_first_of_two_lasers_is_used(drive: Drive, tmp_path: Path) -> None:
    both = sorted([*drive.arrivals, *drive.scans], key=lambda a: a.at_ns)
    report, out = replayed(tmp_path, both)
    clouds = sum(isinstance(a.measurement, PointCloud) for a in both)
    assert report["dropped"] == {"/points": {"another_laser_is_used": clouds}}
    assert ate_m(out, drive.truth) < 0.1


def test_a_lidar_without_a_mount_is_taken_to_look_along_the_band(drive: Drive, tmp_path: Path) -> None:
    report, out = replayed(tmp_path, drive.without(StaticTransforms))
    assert any("no /tf_static" in warning for warning in report["warnings"])
    assert ate_m(out, drive.truth) < 0.2


def test_clouds_of_nothing_are_dropped_with_their_reason(drive: Drive, tmp_path: Path) -> None:
    empty, nan = np.empty((0, 3), np.float32), np.full((10, 3), np.nan, np.float32)
    for points in (empty, nan):
        report, out = replayed(tmp_path, changed(drive.arrivals, points=points, time_s=None))
        clouds = sum(isinstance(a.measurement, PointCloud) for a in drive.arrivals)
        assert report["dropped"] == {"/points": {"no_return": clouds}}
        assert len(lines(out / "trajectory.tum")) == len(drive.truth.stamps_ns)


def test_clouds_of_the_floor_alone_say_nothing(drive: Drive, tmp_path: Path) -> None:
    floor = np.array([[2.0, y, -0.69] for y in np.linspace(-1, 1, 50)], np.float32)
    report, out = replayed(tmp_path, changed(drive.arrivals, points=floor, time_s=None))
    assert report["dropped"] == {}
    assert len(lines(out / "trajectory.tum")) == len(drive.truth.stamps_ns)


def test_a_drive_with_clouds_gives_the_same_bytes_again(drive: Drive, tmp_path: Path) -> None:
    first, second = (replayed(_folder(tmp_path / name), drive.arrivals)[1] for name in ("a", "b"))
    for name in ("trajectory.tum", "online.tum", "graph.g2o", "map.pgm"):
        assert (first / name).read_bytes() == (second / name).read_bytes()


def _folder(path: Path) -> Path:
    path.mkdir()
    return path


def test_a_recording_with_points_is_simulated_on_demand(tmp_path: Path) -> None:
    done = cli("simulate", "office", "--out", tmp_path, "--minutes", "0.1", "--points", "--json")
    assert done.returncode == 0, done.stderr
    report = run(tmp_path / "recording.mcap", tmp_path / "out")
    assert set(report["messages"]) == {"/odom", "/points", "/tf_static", "/wifi"}
