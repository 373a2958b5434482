"""A drive in which the robot is taken elsewhere again and again: pieces of a drive, joined.

The odometry goes on as if nothing had happened. Every other time the robot is carried: its wheels stand while it is
taken, the laser sees the old place and then the new one. Else it is elsewhere from one message to the next.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from benchmarks.localization.drives import Drive, records, stream
from benchmarks.localization.experiments import Result, simulated_map
from benchmarks.localization.maps import KnownMap
from benchmarks.localization.running import MakeLocalizer, run
from benchmarks.localization.scoring import BY_LASER, score

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.measurements import (
    SECOND_NS,
    LaserScan,
    Measurement,
    MovingTransforms,
    Odometry,
    StaticTransforms,
)
from wayfi.frontends.slam_config import SlamConfig
from wayfi.recordings.trajectory import Trajectory

PIECE_S, CARRIED_S, GRACE_S = 60.0, 5.0, 10.0
STANDING_HZ = 10.0


@dataclass(frozen=True, slots=True)
class Piece:
    """A piece of a drive from `start_ns` to `end_ns`, heard `later_ns` later than it was recorded."""

    start_ns: int
    end_ns: int
    later_ns: int

    def truth(self, truth: Trajectory) -> Trajectory:
        """Where the robot is, by the time at which the piece is heard."""
        return Trajectory(truth.stamps_ns + self.later_ns, truth.poses)


def pieces(drive: Drive, count: int, seed: int) -> list[Piece]:
    """`count` pieces from random moments, one after another in time."""
    length_ns = round(PIECE_S * SECOND_NS)
    first, last = int(drive.truth.stamps_ns[0]), int(drive.truth.stamps_ns[-1]) - length_ns
    made: list[Piece] = []
    for number, start_ns in enumerate(np.random.default_rng(seed).integers(first, last, count).tolist()):
        pause_ns = round(CARRIED_S * SECOND_NS) if number % 2 else SECOND_NS // 10
        heard_ns = made[-1].end_ns + made[-1].later_ns + pause_ns if made else start_ns
        made.append(Piece(start_ns, start_ns + length_ns, heard_ns - start_ns))
    return made


def joined(drive: Drive, cut: list[Piece]) -> Iterator[Measurement]:
    """The pieces as one stream."""
    T_odom_base, last_scan = Pose2(), None
    for number, piece in enumerate(cut):
        begun: Pose2 | None = None
        part = list(stream(records(drive.recording), piece.start_ns, piece.end_ns))
        if number % 2:
            first_scan = next((m for m in part if isinstance(m, LaserScan)), None)
            yield from _carried(piece, T_odom_base, last_scan, first_scan, part)
        start = T_odom_base
        for m in part:
            if isinstance(m, StaticTransforms):
                if not number:
                    yield m
                continue
            if isinstance(m, Odometry):
                begun = begun or m.pose
                T_odom_base = start @ begun.between(m.pose)
                yield replace(m, stamp_ns=m.stamp_ns + piece.later_ns, pose=T_odom_base)
            elif not isinstance(m, MovingTransforms):
                last_scan = m if isinstance(m, LaserScan) else last_scan
                yield replace(m, stamp_ns=m.stamp_ns + piece.later_ns)


def _carried(
    piece: Piece,
    T_odom_base: Pose2,
    last_scan: LaserScan | None,
    first_scan: LaserScan | None,
    part: list[Measurement],
) -> Iterator[Measurement]:
    """The wheels stand; the laser sees the old place, and from half way on the new one."""
    standing = next(m for m in part if isinstance(m, Odometry))
    count, step_ns = round(CARRIED_S * STANDING_HZ), round(SECOND_NS / STANDING_HZ)
    start_ns = piece.start_ns + piece.later_ns - count * step_ns
    for k in range(count):
        stamp_ns = start_ns + k * step_ns
        yield replace(standing, stamp_ns=stamp_ns, pose=T_odom_base, twist=(0.0, 0.0, 0.0))
        scan = last_scan if k < count // 2 else first_scan
        if scan is not None:
            yield replace(scan, stamp_ns=stamp_ns)


@dataclass(frozen=True, slots=True)
class Kidnapping:
    """A drive with `count` kidnappings; each of its pieces is a run. False claims of the first seconds are forgiven."""

    name: str
    mapped: Callable[[Path], KnownMap]
    drive: Callable[[Path], Drive]
    count: int = 20

    def results(self, kept: Path, make: MakeLocalizer, count: int, seed: int = 0) -> Iterator[Result]:
        """One run through all pieces, scored piece by piece."""
        known, drive = self.mapped(kept), self.drive(kept)
        cut = pieces(drive, min(count, self.count) + 1, seed)
        start_ns, end_ns = cut[0].start_ns, cut[-1].end_ns + cut[-1].later_ns
        done = run(make(known.building, SlamConfig()), joined(drive, cut), start_ns, end_ns)
        for number, piece in enumerate(cut):
            part = done.part(piece.start_ns + piece.later_ns, piece.end_ns + piece.later_ns)
            truth = piece.truth(drive.truth)
            scored = score(part, truth, known.T_truth_map, BY_LASER, GRACE_S if number else 0.0)
            yield Result(f"{self.name} #{number}", part, scored, truth, known)


def kidnapping(world: str, seed: int) -> Kidnapping:
    """Kidnappings on another day in the building of a map."""
    return Kidnapping(f"{world}, seed {seed}, 20 kidnappings", *simulated_map(world, seed))
