"""How many entries a CDR message says it has, read before each of them becomes an object.

Of millions of empty entries, which fit into one message, the objects take seconds to make.
"""

import struct

from wayfi.frontends.measurements import Sensor
from wayfi.recordings.ros.ros_measurements import MAX_FIELDS, MAX_TRANSFORMS, check_count

_ENCAPSULATION_BYTES = 4
_STAMP_BYTES = 8
_HEIGHT_WIDTH_BYTES = 8


def check_entries(data: bytes, sensor: Sensor) -> None:
    """Raises CodecError where there are too many transforms or point fields, struct.error where `data` is too short."""
    if sensor is Sensor.TF_STATIC:
        check_count("transforms", _number(data, 0), MAX_TRANSFORMS)
    elif sensor is Sensor.POINTS:
        frame_end = _STAMP_BYTES + 4 + _number(data, _STAMP_BYTES)
        check_count("fields of a point", _number(data, (frame_end + 3) // 4 * 4 + _HEIGHT_WIDTH_BYTES), MAX_FIELDS)


def _number(data: bytes, position: int) -> int:
    """The uint32 at `position` after the encapsulation header."""
    order = "<" if data[1:2] == b"\x01" else ">"
    (number,) = struct.unpack_from(order + "I", data, _ENCAPSULATION_BYTES + position)
    return int(number)
