"""ROS messages as JSON with the same field names; a time may have those of ROS 1, `secs` and `nsecs`, or be seconds.

Missing fields are zero, except required ones. JSON has no NaN and no infinity: both are written as `null`. It is read
as infinity in `ranges` and `range_max`, as NaN in the other numbers that are required, and as missing elsewhere.
Numbers may be strings. Bytes (`uint8[]`) are base64, as in rosbridge, or a list of numbers.
"""

import base64
import json
import math
from typing import Any

import numpy as np
from rosbags.interfaces import Nodetype

from wayfi.frontends.measurements import SECOND_NS
from wayfi.recordings.ros.codec_error import CodecError
from wayfi.recordings.ros.messages import (
    LASER_SCAN,
    ODOMETRY,
    POINT_CLOUD,
    POSE_WITH_COVARIANCE,
    TF_MESSAGE,
    TYPESTORE,
    WIFI_SCAN,
)
from wayfi.recordings.ros.ros_measurements import MAX_BEAMS, MAX_FIELDS, MAX_READINGS, MAX_TRANSFORMS, check_count

Message = Any
Description = Any

_POSITION = ("position.x", "position.y")
_ORIENTATION = ("orientation.z", "orientation.w")
REQUIRED: dict[str, frozenset[str]] = {
    ODOMETRY: frozenset({"header.stamp.sec", *(f"pose.pose.{name}" for name in _POSITION + _ORIENTATION)}),
    POSE_WITH_COVARIANCE: frozenset({"header.frame_id", *(f"pose.pose.{name}" for name in _POSITION + _ORIENTATION)}),
    LASER_SCAN: frozenset({"header.stamp.sec", "angle_min", "angle_increment", "range_max", "ranges"}),
    POINT_CLOUD: frozenset(
        {"header.stamp.sec", "height", "width", "point_step", "data"}
        | {f"fields.{name}" for name in ("name", "offset", "datatype")}
    ),
    WIFI_SCAN: frozenset({"header.stamp.sec", "readings", "readings.bssid", "readings.rssi"}),
    TF_MESSAGE: frozenset(
        {"transforms", "transforms.header.frame_id", "transforms.child_frame_id"}
        | {f"transforms.transform.{name}" for name in ("translation.x", "translation.y", "rotation.z", "rotation.w")}
    ),
}
INFINITE_WHERE_NULL = frozenset({"range_max", "ranges"})  # JavaScript writes infinity as null
TIME = "builtin_interfaces/msg/Time"
MOST_SECONDS = 2**31  # of a time, whose `sec` is an int32
ROS1_NAMES = {"sec": "secs", "nanosec": "nsecs"}  # of a time; rosbridge keeps them
MAX_ENTRIES = {
    "ranges": MAX_BEAMS,
    "intensities": MAX_BEAMS,
    "readings": MAX_READINGS,
    "transforms": MAX_TRANSFORMS,
    "fields": MAX_FIELDS,
}
MAX_COMMAS = 250_000  # so many values are read in 40 ms; the largest scan allowed has 100,000
_FLOAT_LIMITS = {"float32": float(np.finfo(np.float32).max), "float64": float(np.finfo(np.float64).max)}


def message_of_json(data: bytes, type_name: str) -> Message:
    """The message of `type_name` in JSON `data`, in UTF-8 or UTF-16, with a byte order mark or without one.

    Bytes that are no text are replaced, and control characters stay: an SSID may hold both. Raises CodecError for
    missing fields, wrong types, numbers out of range and too many entries; ValueError or RecursionError if `data` is
    not JSON.
    """
    check_count("commas", data.count(b","), MAX_COMMAS)
    text = data.decode(json.detect_encoding(data), "replace").rstrip("\0")  # which ends texts in C
    value = json.loads(text, strict=False)
    sent = value.get("msg") if isinstance(value, dict) and "op" in value else None  # as rosbridge wraps messages
    return _message(sent or value, type_name, "", REQUIRED[type_name])


def json_of_message(message: Message, type_name: str) -> bytes:
    """`message` of `type_name` as compact JSON, in ASCII."""
    return json.dumps(_plain_message(message, type_name), allow_nan=False, separators=(",", ":")).encode()


def _message(value: object, type_name: str, path: str, required: frozenset[str]) -> Message:
    if type_name == TIME:
        value = _time(value)
    if not isinstance(value, dict):
        raise CodecError(f"{path or 'the message'} is {_kind(value)}, not a JSON object")
    values: list[Any] = []
    for name, description in TYPESTORE.fielddefs[type_name][1]:
        field_path = f"{path}.{name}" if path else name
        key = name if name in value else ROS1_NAMES.get(name, name)
        if key in value:
            values.append(_field(value[key], description, field_path, required))
        elif field_path in required:
            raise CodecError(f"{field_path} is missing")
        else:
            values.append(_default(description, field_path, required))
    return TYPESTORE.types[type_name](*values)


def _time(value: object) -> object:
    """A time that is a number of seconds, or whose `sec` has a fraction, in whole numbers; any other as it is."""
    seconds = _number(value.get("sec", value.get("secs")) if isinstance(value, dict) else value)
    if isinstance(value, dict) and not (isinstance(seconds, float) and not seconds.is_integer()):
        return value
    if isinstance(seconds, bool) or not isinstance(seconds, int | float) or not abs(seconds) < MOST_SECONDS:
        return value
    sec, nanosec = divmod(round(seconds * SECOND_NS), SECOND_NS)
    return {"sec": sec, "nanosec": nanosec}


def _default(description: Description, path: str, required: frozenset[str]) -> object:
    node, detail = description
    if node == Nodetype.NAME:
        return _message({}, detail, path, required)
    if node == Nodetype.BASE:
        return "" if detail[0] == "string" else _dtype(detail[0])(0).item()
    element, length = detail
    if element[0] == Nodetype.NAME:
        return []
    return np.zeros(length if node == Nodetype.ARRAY else 0, dtype=_dtype(element[1][0]))


def _field(value: object, description: Description, path: str, required: frozenset[str]) -> object:
    node, detail = description
    if node == Nodetype.BASE:
        return _base(value, detail[0], path, required)
    if value is None:
        return _default(description, path, required)
    if node == Nodetype.NAME:
        return _message(value, detail, path, required)
    element, length = detail
    fixed = length if node == Nodetype.ARRAY else None
    return _array(value, element, fixed, path, required)


def _array(value: object, element: Description, fixed: int | None, path: str, required: frozenset[str]) -> object:
    if isinstance(value, str) and element[1][0] == "uint8":
        return np.frombuffer(base64.b64decode(value, validate=True), np.uint8)
    if not isinstance(value, list):
        raise CodecError(f"{path} is {_kind(value)}, not a list")
    check_count(path, len(value), MAX_ENTRIES.get(path, len(value)))
    if fixed is not None and len(value) != fixed:
        raise CodecError(f"{path} has {len(value)} entries, not {fixed}")
    if element[0] == Nodetype.NAME:
        return [_message(item, element[1], path, required) for item in value]
    base = element[1][0]
    return np.array([_base(item, base, path, required) for item in value], dtype=_dtype(base))


def _base(value: object, base: str, path: str, required: frozenset[str]) -> object:
    if base in _FLOAT_LIMITS:
        return _null(path, required) if value is None else _float(value, base, path)
    if value is None and (base == "string" or path not in required):
        return _default((Nodetype.BASE, (base, 0)), path, required)
    if base == "string":
        if not isinstance(value, str):
            raise CodecError(f"{path} is {_kind(value)}, not a string")
        return value.encode("utf-8", "replace").decode()
    if base == "bool":
        if not isinstance(value, bool):
            raise CodecError(f"{path} is {_kind(value)}, not true or false")
        return value
    return _integer(value, base, path)


def _null(path: str, required: frozenset[str]) -> float:
    if path in INFINITE_WHERE_NULL:
        return math.inf
    return math.nan if path in required else 0.0


def _float(value: object, base: str, path: str) -> float:
    value = _number(value)
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise CodecError(f"{path} is {_kind(value)}, not a number")
    if math.isfinite(value) and abs(value) > _FLOAT_LIMITS[base]:
        raise CodecError(f"{path} is out of the range of {base}")
    return float(value)


def _integer(value: object, base: str, path: str) -> int:
    value = _number(value)
    if isinstance(value, float) and value.is_integer():
        value = int(value)
    if isinstance(value, bool) or not isinstance(value, int):
        raise CodecError(f"{path} is {_kind(value)}, not a whole number")
    limits = np.iinfo(_dtype(base))
    if not limits.min <= value <= limits.max:
        raise CodecError(f"{path} is out of the range of {base}")
    return value


def _number(value: object) -> object:
    """The number in a text that holds one in JSON's or Python's spelling; any other value as it is."""
    if not isinstance(value, str) or "_" in value:
        return value
    try:
        return int(value) if value.strip().lstrip("+-").isdecimal() else float(value)
    except ValueError:
        return value


def _dtype(base: str) -> Any:  # noqa: ANN401 - a numpy scalar class
    return np.dtype(base).type


def _kind(value: object) -> str:
    return "null" if value is None else type(value).__name__


def _plain_message(message: Message, type_name: str) -> dict[str, object]:
    fields = TYPESTORE.fielddefs[type_name][1]
    return {name: _plain(getattr(message, name), description) for name, description in fields}


def _plain(value: Any, description: Description) -> object:  # noqa: ANN401 - of the type in `description`
    node, detail = description
    if node == Nodetype.NAME:
        return _plain_message(value, detail)
    if node == Nodetype.BASE:
        return _plain_base(value)
    element = detail[0]
    if element[0] == Nodetype.NAME:
        return [_plain_message(item, element[1]) for item in value]
    if element[1][0] == "uint8":
        return base64.b64encode(value.tobytes()).decode()
    return [_plain_base(item) for item in value.tolist()]


def _plain_base(value: object) -> object:
    return None if isinstance(value, float) and not math.isfinite(value) else value
