"""JSON messages: what is required, what is refused, and how non-finite numbers are read."""

import json
from typing import Any

import pytest
from hypothesis import given, settings
from messages import MEASUREMENTS, assert_same, sensor_of

from wayfi.frontends.measurements import (
    Measurement,
    PointCloud,
    Sensor,
    WifiScan,
)
from wayfi.recordings.ros.codec import decode, encode
from wayfi.recordings.ros.codec_error import CodecError
from wayfi.recordings.ros.topics import Encoding

RELAXED = settings(deadline=None, max_examples=60)


@RELAXED
@given(MEASUREMENTS)
def test_json_round_trip_with_every_non_finite_number_read_as_nan(measurement: Measurement) -> None:
    data = encode(measurement, Encoding.JSON)
    json.loads(data, parse_constant=pytest.fail)
    numbers_as_text = not isinstance(measurement, PointCloud)
    assert_same(measurement, decode(data, sensor_of(measurement), Encoding.JSON), infinity_is_nan=numbers_as_text)


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
        (["header", "stamp", "sec"], 1.5),
        (["header", "stamp", "sec"], "1"),
        (["header", "stamp", "sec"], 2**31),
        (["header", "stamp", "sec"], -1),
        (["header", "stamp", "nanosec"], 10**9),
        (["header", "stamp"], None),
        (["header", "frame_id"], 3),
        (["readings"], {}),
        (["readings", 0], []),
        (["readings", 0, "bssid"], None),
        (["readings", 0, "rssi"], "-60"),
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
