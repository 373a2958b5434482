"""Decodes messages into measurements and encodes them: CDR as in ROS 2, or JSON with the same field names."""

import struct

from rosbags.serde import SerdeError

from wayfi.frontends.measurements import Measurement, Sensor
from wayfi.recordings.ros.cdr_counts import check_entries
from wayfi.recordings.ros.codec_error import CodecError
from wayfi.recordings.ros.json_codec import json_of_message, message_of_json
from wayfi.recordings.ros.messages import TYPE_OF_SENSOR, TYPESTORE
from wayfi.recordings.ros.ros_measurements import to_measurement
from wayfi.recordings.ros.ros_messages import to_message
from wayfi.recordings.ros.topics import Encoding
from wayfi.recordings.ros.wifi_cdr import read_wifi_scan

_MALFORMED = (
    SerdeError,
    struct.error,
    ValueError,
    TypeError,
    OverflowError,
    IndexError,
    RecursionError,
    MemoryError,
)


_BEFORE_JSON = b" \t\r\n\xef\xbb\xbf\xff\xfe"  # blanks, and the byte order marks of UTF-8 and UTF-16
_MOST_BEFORE = 64  # bytes of them
_CDR_HEADERS = (b"\x00\x00", b"\x00\x01")


def encoding_of(data: bytes, said: str) -> str:
    """The encoding of a message of which an encoding is `said`.

    JSON begins with `{`, as CDR never does; and CDR has a header, as JSON never has.
    """
    if data[:_MOST_BEFORE].lstrip(_BEFORE_JSON).startswith(b"{"):
        return Encoding.JSON
    return Encoding.CDR if said == Encoding.JSON and data.startswith(_CDR_HEADERS) else said


def decode(data: bytes, sensor: Sensor, encoding: Encoding) -> Measurement:
    """The measurement of `sensor` in the message `data`; CDR in either byte order. See `encoding_of`.

    A zero quaternion gives a heading of NaN. Non-finite poses and ranges are not an error here. Raises CodecError, and
    nothing else, for malformed data.
    """
    if not data:
        raise CodecError(f"malformed {TYPE_OF_SENSOR[sensor]}: no bytes")
    encoding = Encoding(encoding_of(data, encoding))
    try:
        if encoding is Encoding.JSON:
            return to_measurement(message_of_json(data, TYPE_OF_SENSOR[sensor]), sensor)
        if sensor is Sensor.WIFI:
            return read_wifi_scan(data)
        check_entries(data, sensor)
        return to_measurement(TYPESTORE.deserialize_cdr(memoryview(data), TYPE_OF_SENSOR[sensor]), sensor)
    except _MALFORMED as error:
        raise CodecError(f"malformed {TYPE_OF_SENSOR[sensor]} in {encoding}: {error}") from error


def encode(measurement: Measurement, encoding: Encoding = Encoding.CDR) -> bytes:
    """The message with this measurement. Raises CodecError for values that do not fit its fields."""
    try:
        message, type_name = to_message(measurement)
        if encoding is Encoding.JSON:
            return json_of_message(message, type_name)
        return bytes(TYPESTORE.serialize_cdr(message, type_name, little_endian=True))
    except (*_MALFORMED, AttributeError) as error:
        raise CodecError(f"a {type(measurement).__name__} does not fit its message: {error}") from error
