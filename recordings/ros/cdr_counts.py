"""Checks of the number of entries in a CDR message, before it is decoded.

A message has space for millions of empty entries; decoding them into objects would take seconds.
"""

import struct

from wayfi.frontends.measurements import Sensor
from wayfi.recordings.ros.ros_measurements import MAX_FIELDS, MAX_TRANSFORMS, check_count

_ENCAPSULATION_BYTES = 4
_STAMP_BYTES = 8
_HEIGHT_WIDTH_BYTES = 8


def check_entries(data: bytes, sensor: Sensor) -> None:
    """Raise CodecError for too many transforms or point fields, struct.error if `data` is too short."""
    if sensor in (Sensor.TF_STATIC, Sensor.TF):
        check_count("transforms", _uint32_at(data, 0), MAX_TRANSFORMS)
    elif sensor is Sensor.POINTS:
        frame_end = _STAMP_BYTES + 4 + _uint32_at(data, _STAMP_BYTES)
        check_count("fields of a point", _uint32_at(data, (frame_end + 3) // 4 * 4 + _HEIGHT_WIDTH_BYTES), MAX_FIELDS)


def _uint32_at(data: bytes, position: int) -> int:
    """The uint32 at `position`, counted from the end of the encapsulation header."""
    order = "<" if data[1:2] == b"\x01" else ">"
    (number,) = struct.unpack_from(order + "I", data, _ENCAPSULATION_BYTES + position)
    return int(number)
