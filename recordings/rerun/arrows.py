"""Arrow arrays from numpy arrays. Rerun accepts them as they are; its own conversion doubles the time to log."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pyarrow as pa
import rerun as rr
from numpy.typing import NDArray

_VEC2 = rr.components.Position2DBatch(np.zeros((1, 2))).as_arrow_array().type
_VEC3 = rr.components.Translation3DBatch(np.zeros((1, 3))).as_arrow_array().type
_QUATERNION = rr.components.RotationQuatBatch([rr.Quaternion(xyzw=[0, 0, 0, 1])]).as_arrow_array().type
_STRIPS = rr.components.LineStrip2DBatch([np.zeros((2, 2))]).as_arrow_array().type
_TENSOR = rr.components.TensorDataBatch(np.zeros(1, np.float32)).as_arrow_array().type
_NO_NAMES = pa.array([None], _TENSOR.field("names").type)
_BUFFER = _TENSOR.field("buffer").type
_NO_NUMBERS = tuple(pa.array([], _BUFFER.field(i).type) for i in range(_BUFFER.num_fields))
_F32 = next(i for i in range(_BUFFER.num_fields) if _BUFFER.field(i).name == "F32")
_F32_CODE, _FIRST = pa.py_buffer(bytes([_BUFFER.type_codes[_F32]])), pa.py_buffer(bytes(4))


def points(xy: NDArray[Any]) -> Any:  # noqa: ANN401 - Rerun's types do not mention Arrow
    """(n, 2) points, m."""
    return _vectors(xy, _VEC2)


def translation(x: float, y: float) -> Any:  # noqa: ANN401
    """A translation in the plane, m."""
    return _vectors(np.array([x, y, 0.0]), _VEC3)


def heading(theta: float) -> Any:  # noqa: ANN401
    """A rotation by `theta` (rad) in the plane."""
    return _vectors(np.array([0.0, 0.0, np.sin(theta / 2), np.cos(theta / 2)]), _QUATERNION)


def strips(lines: Sequence[NDArray[Any]] | NDArray[Any]) -> Any:  # noqa: ANN401
    """Line strips, each of (n_i, 2) points, m."""
    ends = np.cumsum([0, *(len(line) for line in lines)], dtype=np.int32)
    joined = np.concatenate(lines) if len(lines) else np.zeros((0, 2))
    return pa.ListArray.from_arrays(pa.array(ends), _vectors(joined, _VEC2), type=_STRIPS)


def _vectors(values: NDArray[Any], kind: pa.DataType) -> pa.Array:
    flat = pa.array(np.ascontiguousarray(values, np.float32).reshape(-1))
    return pa.FixedSizeListArray.from_arrays(flat, type=kind)


def tensor(values: NDArray[Any]) -> Any:  # noqa: ANN401
    """A tensor of (n,) numbers, as float32."""
    flat = pa.array(np.ascontiguousarray(values, np.float32))
    children = list(_NO_NUMBERS)
    children[_F32] = pa.ListArray.from_arrays(pa.array([0, len(values)], pa.int32()), flat, type=children[_F32].type)
    buffer = pa.Array.from_buffers(_BUFFER, 1, [None, _F32_CODE, _FIRST], children=children)
    shape = pa.array([[len(values)]], _TENSOR.field("shape").type)
    return pa.StructArray.from_arrays([shape, _NO_NAMES, buffer], fields=list(_TENSOR))
