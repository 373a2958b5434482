"""JSON messages: what is required, what is refused, and how numbers, nulls and bytes that are no text are read."""

import json
import math
from typing import Any

import pytest
from hypothesis import given, settings
from messages import MEASUREMENTS, assert_same, sensor_of

from wayfi.frontends.measurements import (
    LaserScan,
    Measurement,
    Odometry,
    PointCloud,
    PoseFix,
    Sensor,
    WifiScan,
)
from wayfi.recordings.ros.codec import decode, encode
from wayfi.recordings.ros.codec_error import CodecError
from wayfi.recordings.ros.topics import Encoding

RELAXED = settings(deadline=None, max_examples=60)


@RELAXED
@given(MEASUREMENTS)
def test_json_round_trip_with_every_range_that_is_not_finite_read_as_infinity(measurement: Measurement) -> None:
    data = encode(measurement, Encoding.JSON)
    json.loads(data, parse_constant=pytest.fail)
    numbers_as_text = not isinstance(measurement, PointCloud)
    assert_same(measurement, decode(data, sensor_of(measurement), Encoding.JSON), nan_is_infinity=numbers_as_text)


@pytest.mark.parametrize("sensor", list(Sensor))
@pytest.mark.parametrize(
    "data",
    [b"", b"null", b"[]", b"{}", b"1", b"\xff\xfe", b"[" * 100_000, b'{"header":{"stamp":{"sec":1e999}}}', b"9" * 5000],
    ids=range(9),
)
def test_other_json_is_a_codec_error(data: bytes, sensor: Sensor) -> None:
    with pytest.raises(CodecError):
        decode(data, sensor, Encoding.JSON)


WIFI_JSON: dict[str, Any] = {
    "header": {"stamp": {"sec": 12, "nanosec": 5}, "frame_id": "phone"},
    "readings": [{"bssid": "AA-BB-CC-DD-EE-FF", "rssi": -60}],
}


def test_json_of_a_phone_needs_only_what_matters() -> None:
    scan = decode(json.dumps(WIFI_JSON).encode(), Sensor.WIFI, Encoding.JSON)
    assert isinstance(scan, WifiScan)
    assert (scan.stamp_ns, scan.receiver, scan.bssids) == (12_000_000_005, "phone", ("aa:bb:cc:dd:ee:ff",))
    assert (scan.rssi.tolist(), scan.age_s.tolist(), scan.ssids, scan.frequency_mhz) == ([-60.0], [0.0], ("",), (0,))


@pytest.mark.parametrize(
    ("path", "value"),
    [
        (["header", "stamp", "sec"], 1e12 + 0.5),
        (["header", "stamp", "sec"], "soon"),
        (["header", "stamp", "sec"], None),
        (["header", "stamp", "sec"], "1_000"),
        (["header", "stamp", "sec"], 2**31),
        (["header", "stamp", "sec"], -1),
        (["header", "stamp", "nanosec"], 10**9),
        (["header", "stamp"], None),
        (["header", "stamp"], True),
        (["header", "stamp"], "noon"),
        (["header", "stamp"], 1.7e12),
        (["header", "stamp"], 10**400),
        (["header", "frame_id"], 3),
        (["readings"], {}),
        (["readings", 0], []),
        (["readings", 0, "rssi"], "-60 dBm"),
        (["readings", 0, "rssi"], "-6_0"),
        (["readings", 0, "rssi"], True),
        (["readings", 0, "rssi"], 1e39),
        (["readings", 0, "rssi"], 10**400),
        (["readings", 0, "frequency"], -1),
        (["readings", 0, "frequency"], 2**32),
    ],
)
def test_wrong_json_values_are_codec_errors(path: list[Any], value: object) -> None:
    message = json.loads(json.dumps(WIFI_JSON))
    inner = message
    for key in path[:-1]:
        inner = inner[key]
    inner[path[-1]] = value
    with pytest.raises(CodecError):
        decode(json.dumps(message).encode(), Sensor.WIFI, Encoding.JSON)


@pytest.mark.parametrize(
    ("stamp", "stamp_ns"),
    [
        (12.5, 12_500_000_000),
        (12, 12_000_000_000),
        ("12.5", 12_500_000_000),
        ({"sec": 12.5}, 12_500_000_000),
        ({"secs": "12.5", "nsecs": 0}, 12_500_000_000),
        ({"sec": 12.0, "nanosec": 5}, 12_000_000_005),
        ({"sec": 12.9999999999, "nanosec": 0}, 13_000_000_000),
    ],
)
def test_a_time_may_be_seconds_with_a_fraction(stamp: object, stamp_ns: int) -> None:
    data = json.dumps({"header": {"stamp": stamp}, "readings": []}).encode()
    assert decode(data, Sensor.WIFI, Encoding.JSON).stamp_ns == stamp_ns


@pytest.mark.parametrize(
    "data",
    [
        json.dumps({"op": "publish", "topic": "/wifi", "msg": WIFI_JSON}).encode(),
        json.dumps(WIFI_JSON).encode() + b"\0",
        json.dumps(WIFI_JSON).encode() + b"\n\0\0",
    ],
    ids=["rosbridge", "C string", "filled up"],
)
def test_what_lies_around_a_message_is_left_out(data: bytes) -> None:
    scan = decode(data, Sensor.WIFI, Encoding.JSON)
    assert isinstance(scan, WifiScan)
    assert (scan.stamp_ns, scan.receiver) == (12_000_000_005, "phone")


@pytest.mark.parametrize("path", [["header"], ["readings"], ["readings", 0, "bssid"], ["readings", 0, "rssi"]])
def test_missing_required_json_fields_are_named(path: list[Any]) -> None:
    message = json.loads(json.dumps(WIFI_JSON))
    inner = message
    for key in path[:-1]:
        inner = inner[key]
    del inner[path[-1]]
    with pytest.raises(CodecError, match="is missing"):
        decode(json.dumps(message).encode(), Sensor.WIFI, Encoding.JSON)


def test_lone_surrogates_of_json_do_not_reach_the_measurement() -> None:
    data = b'{"header":{"stamp":{"sec":1},"frame_id":"\\ud800"},"readings":[]}'
    scan = decode(data, Sensor.WIFI, Encoding.JSON)
    assert isinstance(scan, WifiScan)
    scan.receiver.encode()


SCAN_JSON: dict[str, Any] = {
    "header": {"stamp": {"secs": 12, "nsecs": 5}, "frame_id": None},
    "angle_min": "-1.5",
    "angle_max": None,
    "angle_increment": 0.5,
    "time_increment": None,
    "range_min": None,
    "range_max": None,
    "ranges": [1.0, None, "2.5", "inf"],
    "intensities": None,
}


def test_nulls_of_a_scan_are_infinite_ranges_and_unused_fields() -> None:
    scan = decode(json.dumps(SCAN_JSON).encode(), Sensor.SCAN, Encoding.JSON)
    assert isinstance(scan, LaserScan)
    assert scan.ranges.tolist() == [1.0, math.inf, 2.5, math.inf]
    assert (scan.stamp_ns, scan.frame_id, scan.angle_min) == (12_000_000_005, "", -1.5)
    assert (scan.range_min_m, scan.range_max_m, scan.time_increment_s) == (0.0, math.inf, 0.0)


def test_null_is_nan_in_a_pose_and_zero_in_its_covariance() -> None:
    position = {"x": 1.5, "y": None, "z": None}
    pose = {"position": position, "orientation": {"x": None, "y": None, "z": 0, "w": 1}}
    message = {"header": {"stamp": {"sec": 3, "nanosec": None}}, "child_frame_id": None, "twist": None}
    message["pose"] = {"pose": pose, "covariance": [None] * 36}
    odometry = decode(json.dumps(message).encode(), Sensor.ODOM, Encoding.JSON)
    assert isinstance(odometry, Odometry)
    assert (odometry.stamp_ns, odometry.pose.x, odometry.pose.theta) == (3_000_000_000, 1.5, 0.0)
    assert math.isnan(odometry.pose.y)
    assert odometry.covariance is None
    message["pose"] = {"pose": pose, "covariance": None}
    assert_same(odometry, decode(json.dumps(message).encode(), Sensor.ODOM, Encoding.JSON))


def test_nulls_of_a_reading_cost_no_other_one() -> None:
    sound = WIFI_JSON["readings"][0]
    hidden = {"bssid": "00:11:22:33:44:55", "rssi": "-61.5", "ssid": None, "frequency": "2412", "age": None}
    readings = [sound, hidden, {"bssid": None, "rssi": None}]
    scan = decode(json.dumps(WIFI_JSON | {"readings": readings}).encode(), Sensor.WIFI, Encoding.JSON)
    assert isinstance(scan, WifiScan)
    assert scan.bssids == ("aa:bb:cc:dd:ee:ff", "00:11:22:33:44:55", "")
    assert scan.rssi[:2].tolist() == [-60.0, -61.5]
    assert math.isnan(scan.rssi[2])
    assert (scan.ssids, scan.frequency_mhz, scan.age_s.tolist()) == (("", "", ""), (0, 2412, 0), [0.0, 0.0, 0.0])


def test_a_list_that_is_null_is_empty() -> None:
    scan = decode(json.dumps(WIFI_JSON | {"readings": None}).encode(), Sensor.WIFI, Encoding.JSON)
    assert isinstance(scan, WifiScan)
    assert scan.bssids == ()


@pytest.mark.parametrize("ssid", [b"caf\xe9", b"\xff\xfe\x80", b"tab\tbell\x07"])
def test_an_ssid_of_any_bytes_costs_nothing(ssid: bytes) -> None:
    data = json.dumps(WIFI_JSON).encode().replace(b'"rssi"', b'"ssid": "' + ssid + b'", "rssi"')
    scan = decode(data, Sensor.WIFI, Encoding.JSON)
    assert isinstance(scan, WifiScan)
    assert scan.bssids == ("aa:bb:cc:dd:ee:ff",)
    assert scan.ssids == (ssid.decode(errors="replace"),)


@pytest.mark.parametrize(
    ("blanks", "spelling"), [("", "utf-8"), (" \r\n\t", "utf-8"), ("", "utf-8-sig"), ("", "utf-16"), ("", "utf-16-le")]
)
@pytest.mark.parametrize("said", list(Encoding))
def test_what_begins_with_a_brace_is_json_whatever_is_said(blanks: str, spelling: str, said: Encoding) -> None:
    data = (blanks + json.dumps(WIFI_JSON)).encode(spelling)
    assert_same(decode(data, Sensor.WIFI, said), decode(json.dumps(WIFI_JSON).encode(), Sensor.WIFI, Encoding.JSON))


@RELAXED
@given(MEASUREMENTS)
def test_cdr_is_read_as_cdr_whatever_is_said(measurement: Measurement) -> None:
    assert_same(measurement, decode(encode(measurement), sensor_of(measurement), Encoding.JSON))


def test_json_of_a_fix_needs_a_frame_and_a_pose_and_its_stamp_may_be_missing() -> None:
    pose = {"position": {"x": 1, "y": 2}, "orientation": {"z": 0, "w": 1}}
    sent: dict[str, Any] = {"header": {"frame_id": "map"}, "pose": {"pose": pose}}
    fix = decode(json.dumps(sent).encode(), Sensor.FIX, Encoding.JSON)
    assert isinstance(fix, PoseFix)
    assert (fix.stamp_ns, fix.frame_id, fix.T_map_base.array().tolist()) == (0, "map", [1.0, 2.0, 0.0])
    assert fix.covariance is None
    with pytest.raises(CodecError, match=r"header\.frame_id is missing"):
        decode(json.dumps({"pose": {"pose": pose}}).encode(), Sensor.INITIAL_POSE, Encoding.JSON)
    sent["pose"]["covariance"] = [1, 1, 1]
    with pytest.raises(CodecError, match="has 3 entries, not 36"):
        decode(json.dumps(sent).encode(), Sensor.FIX, Encoding.JSON)
