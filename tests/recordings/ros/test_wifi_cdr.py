"""WiFi scans in CDR with SSIDs of any bytes."""

from messages import EXAMPLES

from wayfi.frontends.measurements import (
    Sensor,
    WifiScan,
)
from wayfi.recordings.ros.codec import decode, encode
from wayfi.recordings.ros.topics import Encoding


def test_an_ssid_that_is_not_utf8_does_not_cost_the_scan() -> None:
    data = encode(EXAMPLES[3]).replace("café".encode(), b"caf\xff\xfe")
    scan = decode(data, Sensor.WIFI, Encoding.CDR)
    assert isinstance(scan, WifiScan)
    assert scan.ssids[0] == "home"
    assert len(scan.bssids) == 2
