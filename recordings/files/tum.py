"""Trajectories in the TUM format: lines of `t x y z qx qy qz qw`, t in seconds."""

from decimal import Decimal, InvalidOperation
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.errors import WayfiError
from wayfi.frontends.measurements import SECOND_NS
from wayfi.recordings.files.atomic_files import write_text
from wayfi.recordings.trajectory import Floats, Stamps, Trajectory

_INT64 = np.iinfo(np.int64)


class TrajectoryError(WayfiError):
    """A file that is not a TUM trajectory, or cannot be read."""


def seconds_text(stamp_ns: int) -> str:
    """`stamp_ns` in seconds, exactly, with 9 decimals."""
    whole, fraction = divmod(abs(stamp_ns), SECOND_NS)
    return f"{'-' if stamp_ns < 0 else ''}{whole}.{fraction:09d}"


def stamp_of(text: str) -> int:
    """The nanoseconds of a decimal number of seconds, exactly; half a nanosecond rounds to even.

    Raises ValueError for text that is not a number, and for stamps over 64 bits.
    """
    try:
        stamp_ns = int((Decimal(text) * SECOND_NS).to_integral_value())
    except (InvalidOperation, OverflowError) as error:
        raise ValueError(f"{text!r} is no time in seconds") from error
    if not _INT64.min <= stamp_ns <= _INT64.max:
        raise ValueError(f"{text!r} s is out of range")
    return stamp_ns


def write_tum(path: Path, stamps_ns: Stamps, poses: Floats) -> None:
    """Write `poses` (n, 3) at `stamps_ns` (n,), all numbers with 9 decimals; stamps are exact. Raises OSError."""
    half = poses[:, 2] / 2
    columns = np.stack([poses[:, 0], poses[:, 1], np.sin(half), np.cos(half)], axis=1)
    rounded = np.round(columns, 9) + 0.0  # + 0.0 turns -0.0 into 0.0
    lines = [
        f"{seconds_text(stamp_ns)} {x:.9f} {y:.9f} 0 0 0 {qz:.9f} {qw:.9f}\n"
        for stamp_ns, (x, y, qz, qw) in zip(stamps_ns.tolist(), rounded.tolist(), strict=True)
    ]
    write_text(path, "".join(lines))


def read_tum(path: Path, *, may_be_empty: bool = False) -> Trajectory:
    """The trajectory in the file at `path`, sorted by time. Empty lines and lines that start with # are skipped.

    z, roll and pitch are ignored. Raises TrajectoryError for an unreadable file, a line that is not eight finite
    numbers, and a file without poses unless it `may_be_empty`.
    """
    stamps: list[int] = []
    rows: list[list[float]] = []
    for number, line in enumerate(_read(path).splitlines(), 1):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        try:
            t, *rest = line.split()
            stamps.append(stamp_of(t))
            rows.append(_position_and_quaternion(rest))
        except ValueError as error:
            raise TrajectoryError(f"{path}, line {number}: not `t x y z qx qy qz qw` ({error})") from error
    if not rows and not may_be_empty:
        raise TrajectoryError(f"{path}: no pose in it; a TUM trajectory has `t x y z qx qy qz qw` on each line")
    values, stamps_ns = np.array(rows, float).reshape(-1, 7), np.array(stamps, np.int64)
    order = np.argsort(stamps_ns, kind="stable")
    return Trajectory(stamps_ns[order], np.c_[values[:, :2], _theta(values[:, 3:])][order])


def _read(path: Path) -> str:
    try:
        return path.read_text()
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "not a text file"
        raise TrajectoryError(f"{path}: no trajectory can be read ({reason})") from error


def _position_and_quaternion(words: list[str]) -> list[float]:
    values = [float(word) for word in words]
    if len(values) != 7:
        raise ValueError(f"{len(values) + 1} numbers")
    if not np.isfinite(values).all():
        raise ValueError("a number is not finite")
    if not any(values[3:]):
        raise ValueError("the quaternion is zero")
    return values


def _theta(xyzw: Floats) -> NDArray[np.float64]:
    """(n,) theta (rad) of (n, 4) quaternions, which need not be normalised."""
    x, y, z, w = xyzw.T
    return np.asarray(np.arctan2(2 * (w * z + x * y), w * w + x * x - y * y - z * z))
