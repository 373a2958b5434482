"""The files of a saved map as they are read: each is verified, and what is wrong with it is told."""

from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import pyarrow as pa

from wayfi.backend.errors import WayfiError
from wayfi.recordings.files.replaced_together import current
from wayfi.recordings.map.columns import read_parquet
from wayfi.recordings.map.manifest import Manifest
from wayfi.recordings.map.parts import PartedTable, Row

Value = TypeVar("Value")
UNREADABLE = (pa.ArrowException, WayfiError, KeyError, IndexError, TypeError, ValueError, OverflowError)


class VerifiedFiles:
    """Reads the files of a map's `manifest`; `damaged` tells of each what is wrong with it."""

    def __init__(self, folder: Path, manifest: Manifest) -> None:
        self._folder, self._manifest = folder, manifest
        self.damaged: dict[str, str] = {}

    @property
    def names(self) -> set[str]:
        """The names of all files that the manifest knows."""
        return set(self._manifest.files)

    def read(self, name: str, parse: Callable[[bytes], Value]) -> Value | None:
        """What is in a file; None where it is damaged."""
        data = self.verify(name)
        if data is None:
            return None
        try:
            return parse(data)
        except UNREADABLE as error:
            self.damaged[name] = f"does not hold what it should: {' '.join(str(error).split())}"
            return None

    def verify(self, name: str) -> bytes | None:
        """The bytes of a file; None where they are not those that were saved."""
        checksum = self._manifest.files.get(name)
        if checksum is None:
            self.damaged[name] = "is not in the manifest"
            return None
        try:
            data = current(self._folder, name).read_bytes()
        except OSError as error:
            self.damaged[name] = "is missing" if isinstance(error, FileNotFoundError) else f"{error.strerror}"
            return None
        wrong = checksum.differs(data)
        if wrong:
            self.damaged[name] = wrong
        return None if wrong else data

    def rows(self, table: PartedTable) -> tuple[dict[int, Row], list[str]]:
        """The rows of a table's parts in the order of their numbers, and the names of the parts that are damaged."""
        rows: dict[int, Row] = {}
        parts = sorted((part, name) for name in self._manifest.files if (part := table.part_of(name)) is not None)
        for _, name in parts:
            rows |= self.read(name, lambda data: table.read(read_parquet(data, table.dictionaries))) or {}
        return rows, [name for _, name in parts if name in self.damaged]
