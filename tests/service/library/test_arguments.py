"""What a caller mixes up is said at once: one error for each, with the argument, what it must be and what it is."""

import math
import tomllib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import wayfi
from wayfi import arguments

T = 1_700_000_000_000_000_000
MAC = "aa:bb:cc:dd:ee:ff"
BEAMS = [2.0] * 360


@pytest.fixture(scope="module")
def slam() -> wayfi.Slam:
    return wayfi.Slam()


def odometry(slam: wayfi.Slam, t_ns: object = T, x: object = 0.0, y: object = 0.0, theta: object = 0.0) -> None:
    slam.add_odometry(t_ns, x, y, theta)


def scan(slam: wayfi.Slam, ranges: object = BEAMS, **fields: object) -> None:
    slam.add_scan(T, ranges, **({"angle_min": -3.14, "angle_increment": 0.0175} | fields))


def points(slam: wayfi.Slam, rows: object = ((1.0, 2.0, 3.0),), **fields: object) -> None:
    slam.add_points(T, rows, **fields)


def wifi(slam: wayfi.Slam, rssi: object, **fields: object) -> None:
    slam.add_wifi(T, rssi, **fields)


WRONG: dict[str, tuple[Callable[..., None], dict[str, object], str]] = {
    "seconds as a float": (
        odometry,
        {"t_ns": 1.7e9},
        r"t_ns: must be an int of nanoseconds; it is .*round\(t \* 1e9\)",
    ),
    "a stamp as text": (odometry, {"t_ns": "now"}, "t_ns: must be an int of nanoseconds; it is 'now'"),
    "a flag for a stamp": (odometry, {"t_ns": True}, "t_ns: must be an int"),
    "before the epoch": (odometry, {"t_ns": -1}, "t_ns: must be nanoseconds from 0"),
    "beyond what a message holds": (odometry, {"t_ns": 2**63}, "t_ns: must be nanoseconds from 0"),
    "theta is NaN": (odometry, {"theta": math.nan}, "theta: must be a finite angle in radians; it is nan"),
    "x is text": (odometry, {"x": "1"}, "x: must be a finite number; it is '1'"),
    "y is infinite": (odometry, {"y": math.inf}, "y: must be a finite number; it is inf"),
    "y is complex": (odometry, {"y": np.complex128(1j)}, "y: must be a finite number"),
    "no beam": (scan, {"ranges": []}, r"ranges: must be one number for each beam, \(n,\) in m; it is \[\]"),
    "beams in rows": (scan, {"ranges": np.ones((3, 120))}, r"ranges: .* it is ndarray of shape \(3, 120\)"),
    "one beam": (scan, {"ranges": 2.0}, "ranges: must be one number for each beam"),
    "beams of text": (scan, {"ranges": ["far"] * 360}, "ranges: must be one number for each beam"),
    "beams that are None": (scan, {"ranges": [1.0, None]}, "ranges: must be one number for each beam"),
    "beams of unequal length": (scan, {"ranges": [[1.0], [1.0, 2.0]]}, "ranges: .*its rows differ in length"),
    "no increment": (scan, {"angle_increment": 0.0}, "angle_increment: must be the radians .* not 0; it is 0.0"),
    "the increment is NaN": (scan, {"angle_increment": math.nan}, "angle_increment: must be the radians"),
    "the increment is in degrees": (scan, {"angle_increment": 1.0}, "angle_increment: must be in radians.*degrees"),
    "the first angle is in degrees": (scan, {"angle_min": -180.0}, "angle_min: must be in radians.*degrees"),
    "limits the wrong way round": (
        scan,
        {"range_min": 5.0, "range_max": 1.0},
        "range_max: must be more than range_min",
    ),
    "ranges in millimetres": (scan, {"ranges": np.linspace(500, 8000, 359)}, "ranges: must be in m; .*are these mm"),
    "ranges in millimetres, their limit in m": (
        scan,
        {"ranges": np.linspace(500, 8000, 359), "range_max": 30.0},
        "ranges: must be in m; .*are these mm",
    ),
    "range_max is NaN": (scan, {"range_max": math.nan}, "range_max: must be a number of m, or inf; it is nan"),
    "time_increment in ns": (scan, {"time_increment": 27_000.0}, "time_increment: must be the seconds"),
    "a frame without a name": (scan, {"frame_id": ""}, "frame_id: must be a name"),
    "points in the plane": (points, {"rows": [[1.0, 2.0]]}, r"points: must be one row x, y, z .*\(n, 3\)"),
    "points in millimetres": (
        points,
        {"rows": [[900.0, 1.0, 2.0], [1.0, 901.0, 3.0]]},
        "points: must be in m; .*are these mm",
    ),
    "times for other points": (points, {"point_times": [0.0, 0.1]}, r"point_times: must be .* \(1,\)"),
    "times since the epoch": (points, {"point_times": [1.7e9]}, "point_times: must be the seconds from t_ns"),
    "RSSI in per cent": (wifi, {"rssi": {MAC: 61}}, f"rssi of {MAC}: must be from -120 to 0 dBm; .*per cent"),
    "an RSSI of none": (wifi, {"rssi": {MAC: math.nan}}, f"rssi of {MAC}: must be from -120 to 0 dBm; it is nan"),
    "an RSSI of text": (wifi, {"rssi": {MAC: "-61"}}, f"rssi of {MAC}: must be from -120"),
    "an RSSI below all": (wifi, {"rssi": {MAC: -200.0}}, f"rssi of {MAC}: must be from -120"),
    "an SSID for a BSSID": (wifi, {"rssi": {"cafe": -61.0}}, "rssi: must be keyed by BSSIDs such as .*'cafe'"),
    "a BSSID as a number": (wifi, {"rssi": {17: -61.0}}, "rssi: must be keyed by BSSIDs"),
    "a BSSID twice": (wifi, {"rssi": {MAC: -61.0, MAC.upper(): -60.0}}, "rssi: must be one number for each BSSID"),
    "pairs": (wifi, {"rssi": [(MAC, -61.0)]}, "rssi: must be a mapping from BSSID to dBm"),
    "readings of the future": (wifi, {"rssi": {MAC: -61.0}, "age": -1.0}, "age: must be the seconds"),
    "an age in milliseconds": (wifi, {"rssi": {MAC: -61.0}, "age": 1500}, "age: .* it is 1500.0 .*milliseconds"),
    "a receiver by number": (wifi, {"rssi": {MAC: -61.0}, "receiver": 1}, "receiver: must be a name"),
}


@pytest.mark.parametrize("what", WRONG)
def test_what_cannot_be_right_is_one_clear_error_and_changes_nothing(what: str, slam: wayfi.Slam) -> None:
    add, arguments, said = WRONG[what]
    with pytest.raises(wayfi.ArgumentError, match=said) as error:
        add(slam, **arguments)
    assert "\n" not in str(error.value)
    assert len(str(error.value)) < 300
    assert slam.pose is None


@pytest.mark.parametrize(
    "mount", [(1.0, 2.0), (1.0, 2.0, math.nan), 3.0, "abc", (0, 0, 0, 0, 0, 0, 0), (500.0, 0.0, 0.0)]
)
def test_a_mount_is_three_numbers_or_seven(mount: object, slam: wayfi.Slam) -> None:
    with pytest.raises(wayfi.ArgumentError, match=r"mount: must be \(x, y, theta\) or \(x, y, z, qx, qy, qz, qw\)"):
        slam.set_mount(mount)


def test_a_mount_in_degrees_is_said(slam: wayfi.Slam) -> None:
    with pytest.raises(wayfi.ArgumentError, match=r"mount: .*is its theta in degrees\?"):
        slam.set_mount((0.1, 0, 180))


def test_a_mount_comes_before_the_first_scan_of_its_laser() -> None:
    slam = wayfi.Slam()
    slam.set_mount((0.1, 0.0, 0.0))
    scan(slam)
    slam.set_mount((-0.1, 0.0, 3.14), "rear")
    with pytest.raises(wayfi.ArgumentError, match="must be set before the first scan of 'laser'"):
        slam.set_mount((0.2, 0.0, 0.0))
    assert slam.finish().report["messages"] == {"/tf_static": 2, "/scan": 1}


@pytest.mark.parametrize("no_return", [1e4, 65535.0, math.inf, math.nan])
def test_a_driver_s_number_for_no_return_is_no_unit(no_return: float) -> None:
    slam = wayfi.Slam()
    scan(slam, [no_return] * 300 + [2.0] * 59, range_max=30.0)
    assert slam.finish().report["messages"]["/scan"] == 1


def test_what_is_masked_is_no_return() -> None:
    ranges = np.ma.masked_greater(np.array([2.0, 3.0, 9.0]), 5.0)
    taken = arguments.scan_of(T, ranges, 0.0, 0.1, 0.0, math.inf, 0.0, "laser")
    np.testing.assert_array_equal(taken.ranges, np.float32([2.0, 3.0, np.nan]))
    whole = np.ma.masked_equal(np.array([2, 3, 9]), 9)
    np.testing.assert_array_equal(
        arguments.scan_of(T, whole, 0.0, 0.1, 0.0, math.inf, 0.0, "laser").ranges, np.float32([2.0, 3.0, np.nan])
    )


@pytest.mark.parametrize("config", [3, "", True, ["robot.toml"]])
def test_what_is_no_configuration_is_said(config: object) -> None:
    with pytest.raises(wayfi.ArgumentError, match="config: must be a"):
        wayfi.Slam(config)


def test_nested_mappings_are_a_configuration_which_settings_override(tmp_path: Path) -> None:
    config = {"lidar": {"max_range_m": 12.0, "cloud": {"voxel_m": 0.5}}, "wifi": {"enabled": False}}
    wayfi.Slam(config, **{"wifi.enabled": True}).finish().save(tmp_path)
    text = (tmp_path / "config.toml").read_text()
    assert "max_range_m = 12.0" in text
    assert "voxel_m = 0.5" in text
    assert tomllib.loads(text)["wifi"]["enabled"] is True


@pytest.mark.parametrize("path", [None, 3, "", b"out"])
def test_what_is_no_path_is_said(path: object) -> None:
    with pytest.raises(wayfi.ArgumentError, match="directory: must be a path; it is"):
        wayfi.load_result(path)
    with pytest.raises(wayfi.ArgumentError, match="recording: must be a path"):
        wayfi.replay(path, "out")
    if path is not None:
        with pytest.raises(wayfi.ArgumentError, match="calibration: must be a path"):
            wayfi.Slam(calibration=path)
        with pytest.raises(wayfi.ArgumentError, match="rrd: must be a path"):
            wayfi.Slam(rrd=path)


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"max_range_m": 12}, "max_range_m: there is no such argument; a setting is given by section.key"),
        ({"lidar.max_range": 12}, "lidar.max_range: there is no such key"),
        ({"lidar.max_range_m": "far"}, "lidar.max_range_m: Input should be a valid number"),
        ({"lidar.max_range_m": None}, "lidar.max_range_m: must be a text, a number, .* it is None"),
        ({"lidar.max_range_m": object()}, "lidar.max_range_m: must be a text, a number"),
        ({"lidar.max_range_m": math.nan}, "lidar.max_range_m"),
    ],
)
def test_a_setting_that_does_not_exist_or_fit_is_said(settings: dict[str, object], said: str) -> None:
    with pytest.raises(wayfi.WayfiError, match=said):
        wayfi.Slam(**settings)


def test_what_is_meant_is_taken() -> None:
    slam = wayfi.Slam(**{"lidar.max_range_m": np.float32(12.0), "lidar.mount": np.array([0.1, 0.0, 0.0])})
    slam.set_mount([0.2, 0.0, 0.0])
    slam.add_odometry(np.int64(T), 0, np.float32(0.0), 7 * math.pi / 2)
    slam.add_scan(T, np.array(BEAMS, np.uint16), angle_min=3.14, angle_increment=-0.0175, range_max=30)
    slam.add_points(T, [[1, 2, 3]], point_times=[0])
    slam.add_wifi(T, {"AA-BB-CC-DD-EE-FF": -61, "02:00:00:00:00:01": np.float32(-70.0)}, age=0.5)
    slam.add_wifi(T, {}, receiver="other", age={})
    assert slam.pose == wayfi.Pose2()
    report = slam.finish().report
    assert report["messages"] == {"/odom": 1, "/scan": 1, "/points": 1, "/wifi": 2, "/tf_static": 1}


def test_what_is_handed_in_may_be_used_again() -> None:
    slam, ranges = wayfi.Slam(), np.linspace(2.0, 3.0, 359, dtype=np.float32)
    slam.add_scan(T, ranges, angle_min=-3.14, angle_increment=0.0175)
    ranges[:] = np.nan
    slam.add_odometry(T - 1, 0.0, 0.0, 0.0)
    slam.add_odometry(T + 1, 0.0, 0.0, 0.0)
    assert slam.finish().report["dropped"] == {}
