"""CARMEN logs: the lines' fields, where the lasers are, and which times count."""

import math
from pathlib import Path

import numpy as np
import pytest

from wayfi.frontends.measurements import LaserScan, Measurement, Odometry, Sensor, StaticTransforms
from wayfi.recordings.bags.opening import open_any_recording
from wayfi.recordings.ros.codec import decode
from wayfi.recordings.ros.topics import Encoding

SENSORS = {"/odom": Sensor.ODOM, "/scan": Sensor.SCAN, "/rear_scan": Sensor.SCAN, "/tf_static": Sensor.TF_STATIC}
PARAMETER = "PARAM robot_frontlaser_offset 0.3 nohost 0"
RANGES = " ".join(f"{1 + n / 100:.2f}" for n in range(180))


def read(path: Path, *lines: str) -> list[tuple[str, int, Measurement]]:
    path.write_text("\n".join(lines) + "\n")
    return [(r.topic, r.log_time_ns, decode(r.data, SENSORS[r.topic], Encoding.CDR)) for r in open_any_recording(path)]


def flaser(laser: str, robot: str, times: str = "100.5 host 7.5") -> str:
    return f"FLASER 180 {RANGES} {laser} {robot} {times}"


def mounts_of(measurements: list[tuple[str, int, Measurement]]) -> dict[str, tuple[float, float, float]]:
    (mounts,) = [m for _, _, m in measurements if isinstance(m, StaticTransforms)]
    return {
        t.child_frame_id: (*t.translation_xyz[:2], 2 * math.atan2(t.rotation_xyzw[2], t.rotation_xyzw[3]))
        for t in mounts.transforms
    }


def test_the_robots_time_is_the_stamp_and_the_loggers_the_log_time(tmp_path: Path) -> None:
    odom = "ODOM 1.5 -2 0.5 0.1 0 0 100.25 host 7.25"
    found = read(tmp_path / "a.log", "# a comment", odom, flaser("1.6 -2 0.5", "1.5 -2 0.5"))
    assert [(topic, log_time_ns) for topic, log_time_ns, _ in found] == [
        ("/tf_static", 7_250_000_000),
        ("/odom", 7_250_000_000),
        ("/scan", 7_500_000_000),
    ]
    odometry, scan = found[1][2], found[2][2]
    assert isinstance(odometry, Odometry)
    assert isinstance(scan, LaserScan)
    assert (odometry.stamp_ns, scan.stamp_ns) == (100_250_000_000, 100_500_000_000)
    assert (odometry.pose.x, odometry.pose.y) == (1.5, -2.0)
    assert odometry.pose.theta == pytest.approx(0.5)


def test_a_sick_sees_half_a_turn(tmp_path: Path) -> None:
    (scan,) = [m for _, _, m in read(tmp_path / "a.clf", flaser("0 0 0", "0 0 0")) if isinstance(m, LaserScan)]
    np.testing.assert_allclose(scan.ranges, 1 + np.arange(180) / 100, atol=1e-6)
    assert scan.angle_min == pytest.approx(-math.pi / 2)
    assert scan.angle_increment == pytest.approx(math.radians(1.0))


def test_without_odometry_lines_the_poses_of_the_laser_lines_are_the_odometry(tmp_path: Path) -> None:
    found = read(tmp_path / "a.log", flaser("2 0 0", "1 0 0"), flaser("3 0 0", "2 0 0", "101.5 host 8.5"))
    assert [m.pose.x for _, _, m in found if isinstance(m, Odometry)] == [1.0, 2.0]


@pytest.mark.parametrize(
    ("lines", "place"),
    [
        ([flaser("1 0.2 1.57079633", "1 0 1.57079633")] * 2, (0.2, 0.0)),
        ([PARAMETER, flaser("1 0 0", "1 0 0")], (0.3, 0.0)),
        (
            ["PARAM robot_frontlaser_offset 0.3 nohost 0", flaser("1 0 0", "0 0 0"), flaser("5 0 0", "2 0 0")],
            (0.3, 0.0),
        ),
        ([flaser("1 0 0", "0 0 0"), flaser("5 0 0", "2 0 0")], (0.0, 0.0)),
    ],
    ids=["as the lines agree", "as the parameter says", "of poses that were corrected", "unknown"],
)
def test_where_the_laser_is(tmp_path: Path, lines: list[str], place: tuple[float, float]) -> None:
    assert mounts_of(read(tmp_path / "a.log", *lines))["laser"] == pytest.approx((*place, 0.0), abs=1e-6)


def test_a_rear_laser_looks_back_on_a_topic_of_its_own(tmp_path: Path) -> None:
    rear = flaser("1 0 3.14159265", "1 0 0").replace("FLASER", "RLASER")
    found = read(tmp_path / "a.log", rear)
    assert [topic for topic, _, m in found if isinstance(m, LaserScan)] == ["/rear_scan"]
    assert mounts_of(found)["rear_laser"][2] == pytest.approx(math.pi)


def test_a_robot_laser_says_its_own_angles(tmp_path: Path) -> None:
    line = f"ROBOTLASER1 0 -2.0 4.0 0.0223 12.5 0.01 0 180 {RANGES} 2 0 0 1.1 2 0 1 2 0 0 0 0.5 0.5 1e6 9.5 host 9.25"
    (scan,) = [m for _, _, m in read(tmp_path / "a.log", line) if isinstance(m, LaserScan)]
    assert (scan.angle_min, scan.angle_increment, scan.range_max_m) == pytest.approx((-2.0, 0.0223, 12.5))
    assert len(scan.ranges) == 180


def test_broken_lines_are_counted_and_told(tmp_path: Path) -> None:
    broken = ["ODOM 1 2", "ODOM a b c 0 0 0 1.0 host 1.0", "FLASER 180 1 2 3 0 0 0 0 0 0 1.0 host 1.0"]
    read(tmp_path / "a.log", *broken, "ODOM 1 2 0 0 0 0 1.0 host 1.0", "ODOM 1 nan 0 0 0 0 1.0 host 1.0")
    (line,) = open_any_recording(tmp_path / "a.log").warnings
    assert "4 lines cannot be read" in line


def test_raw_laser_lines_are_told_where_there_are_no_others(tmp_path: Path) -> None:
    path, odom = tmp_path / "raw.log", "ODOM 1.5 -2 0.5 0.1 0 0 100.25 host 7.25"
    raw = f"RAWLASER1 0 -1.57 3.14 0.0174 80 0.01 0 180 {RANGES} 0 100.5 host 7.5"
    path.write_text(f"{odom}\n{raw}\n")
    (told,) = open_any_recording(path).warnings
    assert "its 1 RAWLASER1 lines are not read" in told
    path.write_text(f"{odom}\n{raw}\n{flaser('1.6 -2 0.5', '1.5 -2 0.5')}\n")
    assert not open_any_recording(path).warnings
