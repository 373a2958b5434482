"""A recording as the batch method takes it."""

from pathlib import Path

import numpy as np
import pytest
from drives import Arrival, write
from reproduced_drives import silent

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.measurements import SECOND_NS, LaserScan, Measurement, Odometry, WifiScan
from wayfi.service.reproduction.errors import ReproductionError
from wayfi.service.reproduction.recorded_drive import RecordedDrive, read_drive


def arrivals(*measurements: Measurement) -> list[Arrival]:
    return [Arrival(m.stamp_ns, m) for m in measurements]


def wheels(seconds: int, speed_m_s: float = 0.5) -> list[Arrival]:
    """Straight on, ten times a second."""
    return arrivals(*(Odometry(t * SECOND_NS // 10, Pose2(speed_m_s * t / 10, 0.0, 0.0)) for t in range(10 * seconds)))


def wifi_scan(second: float, age_s: float = 0.0, rssi: float = -50.0) -> WifiScan:
    bssids = ("02:00:00:00:00:01", "02:00:00:00:00:02")
    levels = np.full(2, rssi, np.float32)
    return WifiScan(round(second * SECOND_NS), "phone", bssids, levels, np.full(2, age_s, np.float32))


def laser_scan(second: float) -> LaserScan:
    """A wall 4 m ahead of the place where the scan is taken."""
    ranges = (4.0 / np.cos(np.linspace(-0.5, 0.5, 101))).astype(np.float32)
    return LaserScan(round(second * SECOND_NS), "base_link", ranges, -0.5, 0.01, 0.1, 20.0)


def drive_of(tmp_path: Path, received: list[Arrival]) -> RecordedDrive:
    return read_drive(write(tmp_path / "recording.mcap", received), silent)


def test_a_pose_is_where_the_robot_was_when_its_readings_were_heard(tmp_path: Path) -> None:
    drive = drive_of(tmp_path, wheels(20) + arrivals(wifi_scan(10.0, age_s=4.0), wifi_scan(8.0), wifi_scan(99.0)))
    assert (drive.stamps_ns / SECOND_NS).tolist() == [6.0, 8.0]
    np.testing.assert_allclose(drive.poses, [[3.0, 0.0, 0.0], [4.0, 0.0, 0.0]], atol=1e-9)
    np.testing.assert_allclose(drive.path_m, [3.0, 4.0], atol=1e-9)
    assert len(drive.odometry) == 200
    assert drive.scans == {}


def test_a_pose_has_the_scan_nearest_in_time_carried_over_by_the_odometry(tmp_path: Path) -> None:
    """Of two poses one scan is the nearer one's, and a scan 3 s away is nobody's."""
    heard = [wifi_scan(second) for second in (4.0, 5.0, 12.0)]
    drive = drive_of(tmp_path, wheels(20) + arrivals(*heard, laser_scan(5.4), laser_scan(15.5)))
    assert list(drive.scans) == [1]
    points = drive.scans[1].points
    np.testing.assert_allclose(points[:, 0], 4.0 + 0.4 * 0.5, atol=1e-5)


def test_absurd_readings_make_no_fingerprint(tmp_path: Path) -> None:
    received = wheels(20) + arrivals(wifi_scan(5.0), wifi_scan(6.0, rssi=3.0), wifi_scan(7.0))
    assert len(drive_of(tmp_path, received).readings) == 2


@pytest.mark.parametrize(
    ("received", "why"),
    [(wheels(20), "no WiFi"), (arrivals(wifi_scan(1.0), wifi_scan(2.0)), "no odometry")],
)
def test_a_recording_without_what_the_method_needs_is_refused(
    tmp_path: Path, received: list[Arrival], why: str
) -> None:
    with pytest.raises(ReproductionError, match=why):
        drive_of(tmp_path, received)
