"""A CDR reader for WifiScan alone: three times as fast as the typestore's, and it accepts SSIDs of any bytes.

An SSID has up to 32 bytes without a defined encoding. Bytes that are not UTF-8 are replaced, so that one such network
does not cost the whole scan.
"""

from struct import Struct

import numpy as np

from wayfi.frontends.measurements import WifiScan
from wayfi.recordings.ros.codec_error import CodecError
from wayfi.recordings.ros.ros_measurements import MAX_READINGS, check_count, check_name, stamp_ns_of, wifi_scan

_ORDERS = {b"\x00\x00": ">", b"\x00\x01": "<"}
_TIME = {order: Struct(order + "iI") for order in "<>"}
_LENGTH = {order: Struct(order + "I") for order in "<>"}
_NUMBERS = {order: Struct(order + "fIf") for order in "<>"}
_SMALLEST_READING_BYTES = 28
_PADDING_BYTES = 3


def read_wifi_scan(data: bytes) -> WifiScan:
    """The WiFi scan in CDR `data`, in either byte order.

    Raises CodecError, struct.error or UnicodeDecodeError for malformed data.
    """
    order = _ORDERS.get(data[:2])
    if order is None or len(data) < 4:
        raise CodecError("no CDR header")
    body = data[4:]
    stamp_ns = stamp_ns_of(*_TIME[order].unpack_from(body, 0))
    receiver, position = _string(body, 8, _LENGTH[order], "strict")
    check_name(receiver)
    position = _aligned(position)
    (count,) = _LENGTH[order].unpack_from(body, position)
    check_count("readings", count, MAX_READINGS)
    if count * _SMALLEST_READING_BYTES > len(body) - position:
        raise CodecError(f"WifiScan says {count} readings and has {len(body) - position} bytes left")
    return _read_readings(body, position + 4, count, order, stamp_ns, receiver)


def _read_readings(body: bytes, position: int, count: int, order: str, stamp_ns: int, receiver: str) -> WifiScan:
    length, numbers = _LENGTH[order], _NUMBERS[order]
    bssids, ssids, values = [], [], []
    for _ in range(count):
        bssid, position = _string(body, _aligned(position), length, "replace")
        ssid, position = _string(body, _aligned(position), length, "replace")
        position = _aligned(position)
        values.append(numbers.unpack_from(body, position))
        position += numbers.size
        bssids.append(bssid)
        ssids.append(ssid)
    if len(body) - position > _PADDING_BYTES:
        raise CodecError(f"{len(body) - position} bytes too many at the end of a WifiScan")
    rssi, frequency_mhz, age_s = zip(*values, strict=True) if values else ((), (), ())
    rssi_dbm, ages = np.array(rssi, dtype=np.float32), np.array(age_s, dtype=np.float32)
    return wifi_scan(stamp_ns, receiver, bssids, ssids, rssi_dbm, frequency_mhz, ages)


def _aligned(position: int) -> int:
    return (position + 3) & -4


def _string(body: bytes, position: int, length: Struct, errors: str) -> tuple[str, int]:
    (size,) = length.unpack_from(body, position)
    end = position + 4 + size
    if size < 1 or end > len(body) or body[end - 1] != 0:
        raise CodecError(f"string of {size} bytes at byte {position} does not end in the message")
    return body[position + 4 : end - 1].decode("utf-8", errors), end
