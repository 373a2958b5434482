"""The points of a PointCloud2, with any order of fields, organised or not, in either byte order."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from wayfi.recordings.ros.codec_error import CodecError

MAX_POINTS = 10_000_000
TIME_FIELDS = ("time", "t", "timestamp", "time_stamp", "offset_time", "time_offset")
"""The names of the time field: of Velodyne, of Ouster, of Hesai and RoboSense, then of Livox and others."""
_FLOAT_OF_DATATYPE = {7: "f4", 8: "f8"}
_NUMBER_OF_DATATYPE = {5: "i4", 6: "u4"} | _FLOAT_OF_DATATYPE


def points_of_cloud(message: Any) -> tuple[NDArray[np.float32], NDArray[Any] | None]:  # noqa: ANN401 - a class the typestore generates
    """(n, 3) float32 x, y, z (m) of a PointCloud2 `message`, and (n,) times in the driver's unit, None without times.

    Organised clouds are flattened row by row. Raises CodecError if x, y or z is missing or not a float, and if the
    sizes do not fit the data.
    """
    if message.height * message.width == 0:
        return np.zeros((0, 3), dtype=np.float32), None
    layout = _point_dtype(message)
    row_step = message.row_step or message.width * message.point_step
    _check_sizes(message, row_step)
    cloud = np.ndarray(
        (message.height, message.width), layout, buffer=message.data, strides=(row_step, message.point_step)
    )
    points = np.empty((cloud.size, 3), dtype=np.float32)
    with np.errstate(over="ignore", invalid="ignore"):
        for column, axis in enumerate("xyz"):
            points[:, column] = cloud[axis].reshape(-1)
    return points, cloud["time"].reshape(-1) if "time" in (layout.names or ()) else None


def _point_dtype(message: Any) -> np.dtype[np.void]:  # noqa: ANN401
    order = ">" if message.is_bigendian else "<"
    fields = {field.name: field for field in message.fields}
    names, formats, offsets = [], [], []
    for axis in "xyz":
        if axis not in fields or fields[axis].datatype not in _FLOAT_OF_DATATYPE:
            raise CodecError(f"PointCloud2 has no float field {axis!r}")
        names.append(axis)
        formats.append(order + _FLOAT_OF_DATATYPE[fields[axis].datatype])
        offsets.append(fields[axis].offset)
    time_field = next(
        (fields[n] for n in TIME_FIELDS if n in fields and fields[n].datatype in _NUMBER_OF_DATATYPE), None
    )
    if time_field is not None:
        names.append("time")
        formats.append(order + _NUMBER_OF_DATATYPE[time_field.datatype])
        offsets.append(time_field.offset)
    if max(offset + int(form[-1]) for offset, form in zip(offsets, formats, strict=True)) > message.point_step:
        raise CodecError(f"PointCloud2's fields do not fit its point_step of {message.point_step} bytes")
    return np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": message.point_step})


def _check_sizes(message: Any, row_step: int) -> None:  # noqa: ANN401
    row_bytes = message.width * message.point_step
    if message.height > 1 and row_step < row_bytes:
        raise CodecError(f"PointCloud2's row_step of {row_step} bytes is less than its {message.width} points take")
    if (message.height - 1) * row_step + row_bytes > len(message.data):
        raise CodecError(
            f"PointCloud2 says {message.height} x {message.width} points and carries {len(message.data)} bytes"
        )
    if message.height * message.width > MAX_POINTS:
        raise CodecError(f"PointCloud2 of {message.height * message.width} points; the limit is {MAX_POINTS}")
