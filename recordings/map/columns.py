"""Columns of the saved map's tables as numpy arrays, and the Parquet files that hold them."""

import io
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from wayfi.backend.pose2 import Floats
from wayfi.frontends.measurements import SECOND_NS

Column = Any  # of pyarrow, which has no types
PER_M = 1_000  # lengths of scans are kept in mm: a laser's noise is ten times that
PER_RAD = 10_000  # directions of normals
UNKNOWN_NORMAL = -32_768
COMPRESSION_LEVEL = 3  # of zstd; 9 saves 3 % of a scan and takes four times as long


def parquet(columns: Mapping[str, Column | NDArray[Any]], small_numbers: Sequence[str] = ()) -> bytes:
    """A Parquet file of columns of one length.

    The lists of integers in `small_numbers` are split by bytes, which compresses to two thirds of what else it would.
    """
    data = io.BytesIO()
    encoding = {f"{name}.list.element": "BYTE_STREAM_SPLIT" for name in small_numbers}
    pq.write_table(
        pa.table({name: _column(values) for name, values in columns.items()}),
        data,
        compression="zstd",
        compression_level=COMPRESSION_LEVEL,
        use_dictionary=not small_numbers,
        column_encoding=encoding or None,
    )
    return data.getvalue()


def read_parquet(data: bytes, dictionaries: Sequence[str] = ()) -> "Table":
    """The table in a Parquet file; the columns in `dictionaries` are of few different words. Raises ValueError."""
    return Table(pq.ParquetFile(pa.BufferReader(data), read_dictionary=list(dictionaries)).read(use_threads=False))


class Table:
    """The columns of a table that was read, by their names. Raises KeyError for one that is not in it."""

    def __init__(self, table: Column) -> None:
        self._table = table

    def __len__(self) -> int:
        return int(self._table.num_rows)

    def __contains__(self, name: str) -> bool:
        return name in self._table.column_names

    def numbers(self, name: str) -> NDArray[Any]:
        """(n,) values, NaN where there is none."""
        return np.asarray(self._table.column(name).to_numpy())

    def matrix(self, names: Sequence[str]) -> Floats:
        """(n, m) float64 of m columns."""
        return np.column_stack([self.numbers(name) for name in names]).astype(np.float64).reshape(-1, len(names))

    def values(self, name: str) -> list[Any]:
        """Values as Python's own; None where there is none."""
        return list(self._table.column(name).to_pylist())

    def flat(self, name: str) -> tuple[NDArray[Any], NDArray[Any]]:
        """The numbers of all rows of a column of lists, and (n + 1,) where each row begins, and the last ends."""
        column = self._whole(name)
        return np.asarray(column.values.to_numpy(zero_copy_only=False)), np.asarray(column.offsets.to_numpy())

    def lists(self, name: str) -> list[NDArray[Any]]:
        """An array for each row of a column of lists of numbers."""
        return split(*self.flat(name))

    def words(self, name: str) -> list[tuple[str, ...]]:
        """The words of each row of a column of lists, which was read as one of few different words."""
        column = self._whole(name)
        words, numbers = column.values.dictionary.to_pylist(), column.values.indices.to_numpy().tolist()
        spoken, offsets = [words[number] for number in numbers], column.offsets.to_numpy().tolist()
        return [tuple(spoken[a:b]) for a, b in pairwise(offsets)]

    def _whole(self, name: str) -> Column:
        """A column in one piece."""
        return self._table.column(name).combine_chunks()


def lists(rows: Sequence[Any]) -> Column:
    """A column of lists of numbers, one for each array of `rows`."""
    values = np.concatenate(rows) if len(rows) else np.empty(0)
    return pa.ListArray.from_arrays(_offsets(rows), pa.array(values))


def word_lists(rows: Sequence[Sequence[str]]) -> Column:
    """A column of lists of words."""
    return pa.ListArray.from_arrays(_offsets(rows), pa.array([word for row in rows for word in row], pa.string()))


def split(values: NDArray[Any], offsets: NDArray[Any]) -> list[NDArray[Any]]:
    """The `values` of each row, of which row k is `offsets[k]` to `offsets[k + 1]`."""
    return [values[a:b] for a, b in pairwise(offsets.tolist())]


def quanta(values: NDArray[Any], per_unit: int) -> NDArray[np.int32]:
    """Values as whole numbers of their quantum, which goes `per_unit` times into their unit."""
    return np.rint(values * np.float64(per_unit)).astype(np.int32)


def utc(stamp_ns: int) -> str:
    """A stamp as the time of day in UTC."""
    return f"{np.datetime64(stamp_ns // SECOND_NS, 's')}Z"


def _column(values: Column | NDArray[Any]) -> Column:
    return values if isinstance(values, pa.Array) else pa.array(values)


def _offsets(rows: Sequence[Any]) -> Column:
    return pa.array(np.concatenate([[0], np.cumsum([len(row) for row in rows], dtype=np.int64)]).astype(np.int32))
