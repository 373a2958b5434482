"""Tables in numbered files of a bounded number of rows: a save writes those anew in which a row has changed."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from wayfi.frontends.maps.building_map import BuildingMap
from wayfi.recordings.map.closure_table import closure_table, read_closures
from wayfi.recordings.map.columns import Table
from wayfi.recordings.map.factor_table import factor_table, read_factors
from wayfi.recordings.map.fingerprint_table import BSSIDS, fingerprint_table, read_fingerprints
from wayfi.recordings.map.scan_table import read_scans, scan_table

Row = Any
Made = tuple[Any, ...]  # what a row was made of: numbers, and values that are never changed


@dataclass(frozen=True, slots=True)
class PartedTable:
    """A table whose row n is in part n // `rows`, in the file `stem`_NNNN.parquet."""

    stem: str
    rows: int
    rows_of: Callable[[BuildingMap], Iterable[tuple[int, Row]]]
    made_of: Callable[[Row], Made]
    write: Callable[[Sequence[int], Sequence[Row]], bytes]
    read: Callable[[Table], Mapping[int, Row]]
    dictionaries: tuple[str, ...] = ()

    def parts(self, building: BuildingMap) -> dict[int, dict[int, Row]]:
        """The rows of each part by their numbers."""
        parts: dict[int, dict[int, Row]] = {}
        for number, row in self.rows_of(building):
            parts.setdefault(number // self.rows, {})[number] = row
        return parts

    def file(self, part: int) -> str:
        """The name of a part's file."""
        return f"{self.stem}_{part:04d}.parquet"

    def part_of(self, file: str) -> int | None:
        """The number of the part in a file; None where it is no part of this table."""
        number = file.removeprefix(f"{self.stem}_").removesuffix(".parquet")
        return int(number) if number.isdecimal() and self.file(int(number)) == file else None


SCANS = PartedTable(
    "scans", 256,  # 0.9 MB
    lambda building: enumerate((keyframe.scan, keyframe.hits) for keyframe in building.keyframes),
    lambda scan: scan, scan_table, read_scans,
)  # fmt: skip
FACTORS = PartedTable(
    "factors", 2048,
    lambda building: building.factors.items(),
    lambda factor: (factor,), factor_table, read_factors,
)  # fmt: skip
CLOSURES = PartedTable(
    "closures", 512,
    lambda building: enumerate((closure, k in building.vetoed) for k, closure in enumerate(building.closures)),
    lambda row: (row[0].judged, *row[0].factors, row[1]), closure_table, read_closures,
)  # fmt: skip
FINGERPRINTS = PartedTable(
    "fingerprints", 512,
    lambda building: enumerate(building.fingerprints),
    lambda f: (f.readings, f.T_keyframe_base, f.keyframe, f.stamp_ns), fingerprint_table, read_fingerprints,
    (BSSIDS,),
)  # fmt: skip
TABLES = (SCANS, FACTORS, CLOSURES, FINGERPRINTS)


def same(a: Sequence[Made], b: Sequence[Made]) -> bool:
    """Whether rows were made of the same values: equal numbers, and otherwise the very same ones."""
    return len(a) == len(b) and all(_same(one, other) for one, other in zip(a, b, strict=True))


def _same(one: Made, other: Made) -> bool:
    return len(one) == len(other) and all(
        a is b or (isinstance(a, int) and a == b) for a, b in zip(one, other, strict=True)
    )
