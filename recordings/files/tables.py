"""closures.csv and radio.csv: the tables of a replay."""

import csv
import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.errors import WayfiError
from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.events import ClosureJudged, ClosureKind, Verdict
from wayfi.recordings.files.atomic_files import write_csv
from wayfi.recordings.files.tum import seconds_text

CLOSURE_COLUMNS = [
    *("stamp_a_ns", "stamp_b_ns", "kind", "proposed_by", "similarity", "residual_m", "inlier_ratio"),
    *("dx_m", "dy_m", "dtheta_rad", "cxx", "cxy", "cxt", "cyy", "cyt", "ctt", "verdict", "reason"),
]
RADIO_COLUMNS = ["t", "x", "y", "receiver", "bssid", "rssi"]
_UPPER = np.triu_indices(3)


class TableError(WayfiError):
    """A file that is not a closures.csv, or cannot be read."""


@dataclass(frozen=True, slots=True, eq=False)
class ClosureRow:
    """One row of closures.csv: a candidate T_a_b between two stamps and its verdict at the end.

    `covariance` (3, 3) is in (x, y, theta) of a, in m and rad. Where the closure claims no heading, theta is 0 and the
    covariance's theta row and column are NaN. An empty number in the file is NaN.
    """

    stamp_a_ns: int
    stamp_b_ns: int
    kind: ClosureKind
    proposed_by: str
    similarity: float
    residual_m: float
    inlier_ratio: float
    T_a_b: Pose2
    covariance: Floats
    heading_claimed: bool
    verdict: Verdict
    reason: str


@dataclass(frozen=True, slots=True, eq=False)
class RadioPlace:
    """A fingerprint at its estimated position x, y (m, in map): `rssi` (n,) in dBm, one for each of `bssids`."""

    stamp_ns: int
    x: float
    y: float
    receiver: str
    bssids: tuple[str, ...]
    rssi: NDArray[np.float32]


def write_closures(path: Path, verdicts: Iterable[ClosureJudged]) -> None:
    """Write a row for each candidate, in order of appearance, with the last verdict on it. Raises OSError."""
    last = {verdict.closure: verdict for verdict in verdicts}
    write_csv(path, CLOSURE_COLUMNS, (_closure_fields(verdict) for verdict in last.values()))


def read_closures(path: Path) -> list[ClosureRow]:
    """The rows of the closures.csv at `path`. Raises TableError for an unreadable file, wrong header or wrong value."""
    try:
        with path.open(newline="", encoding="utf-8") as file:
            rows = csv.DictReader(file)
            if rows.fieldnames != CLOSURE_COLUMNS:
                raise TableError(f"{path}: its first line is not the header of closures.csv; was it written by wayfi?")
            return [_closure_row(row, f"{path}, line {rows.line_num}") for row in rows]
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "not a text file"
        raise TableError(f"{path}: no closures can be read ({reason})") from error


def closure_row(verdict: ClosureJudged) -> ClosureRow:
    """The row of a candidate with this last verdict."""
    covariance, T_a_b = np.array(verdict.covariance, float), verdict.T_a_b
    if not verdict.heading_claimed:
        T_a_b = Pose2(T_a_b.x, T_a_b.y, 0.0)
        covariance[2, :] = covariance[:, 2] = math.nan
    return ClosureRow(
        verdict.stamp_a_ns, verdict.stamp_b_ns, verdict.kind, verdict.proposed_by, verdict.similarity,
        verdict.residual_m, verdict.inlier_ratio, T_a_b, covariance, verdict.heading_claimed, verdict.verdict,
        verdict.reason,
    )  # fmt: skip


def write_radio(path: Path, places: Iterable[RadioPlace]) -> None:
    """Write a row for each reading, in the order given. Raises OSError."""
    write_csv(path, RADIO_COLUMNS, (fields for place in places for fields in _radio_fields(place)))


def _closure_fields(verdict: ClosureJudged) -> list[str]:
    covariance = np.array(verdict.covariance, float)
    theta = verdict.T_a_b.theta
    if not verdict.heading_claimed:
        theta = covariance[2, :] = covariance[:, 2] = math.nan
    return [
        str(verdict.stamp_a_ns),
        str(verdict.stamp_b_ns),
        verdict.kind.value,
        verdict.proposed_by,
        *(_text(value, ".4f") for value in (verdict.similarity, verdict.residual_m, verdict.inlier_ratio)),
        *(_text(value, ".6f") for value in (verdict.T_a_b.x, verdict.T_a_b.y, theta)),
        *(_text(value, ".6e") for value in covariance[_UPPER].tolist()),
        verdict.verdict.value,
        verdict.reason,
    ]


def _text(value: float, form: str) -> str:
    return "" if math.isnan(value) else format(value, form)


def _closure_row(row: dict[str, str], where: str) -> ClosureRow:
    try:
        covariance = np.empty((3, 3))
        covariance[_UPPER] = [_number(row[column]) for column in CLOSURE_COLUMNS[10:16]]
        covariance.T[_UPPER] = covariance[_UPPER]
        heading_claimed = row["dtheta_rad"] != ""
        theta = float(row["dtheta_rad"]) if heading_claimed else 0.0
        return ClosureRow(
            stamp_a_ns=int(row["stamp_a_ns"]),
            stamp_b_ns=int(row["stamp_b_ns"]),
            kind=ClosureKind(row["kind"]),
            proposed_by=row["proposed_by"],
            similarity=_number(row["similarity"]),
            residual_m=_number(row["residual_m"]),
            inlier_ratio=_number(row["inlier_ratio"]),
            T_a_b=Pose2(_number(row["dx_m"]), _number(row["dy_m"]), theta),
            covariance=covariance,
            heading_claimed=heading_claimed,
            verdict=Verdict(row["verdict"]),
            reason=row["reason"],
        )
    except (ValueError, TypeError) as error:
        raise TableError(f"{where}: not a row of closures.csv ({error})") from error


def _number(text: str) -> float:
    return float(text) if text else math.nan


def _radio_fields(place: RadioPlace) -> Iterator[list[str]]:
    head = [seconds_text(place.stamp_ns), f"{place.x:.3f}", f"{place.y:.3f}", place.receiver]
    for bssid, rssi in zip(place.bssids, place.rssi.tolist(), strict=True):
        yield [*head, bssid, f"{rssi:.2f}"]
