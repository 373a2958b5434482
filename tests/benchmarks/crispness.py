"""How crisp the walls of a map are, for recordings without a reference.

    python tests/benchmarks/crispness.py RECORDING [--set key=value ...]

Prints the area that the laser's hits fill, as estimated and by the wheels alone. Where walls double it grows.
"""

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.events import Event, KeyframeAdded
from wayfi.recordings.mcap.recording import open_recording
from wayfi.service.config import load_config
from wayfi.service.drive.drive import Drive
from wayfi.service.replay.replayers import PlainReplayer

CELL_M = 0.05  # a laser's noise and the width of a thinned wall: a finer cell would count beams, not walls
NOTHING_MATCHED = ("lidar.min_inlier_ratio=2.0", "closure.min_inlier_ratio=2.0", "closure.overlap.min_inlier_ratio=2.0")
WHEELS_ALONE = ("wifi.enabled=false", "lidar.clock.min_turns=1000000", *NOTHING_MATCHED)


@dataclass(frozen=True, slots=True, eq=False)
class KeyframeScans:
    """A log that keeps each keyframe's scan, (n, 2) m in base_link, by the keyframe's number."""

    points: dict[int, Floats] = field(default_factory=dict)

    def log(self, event: Event) -> None:
        """Keep the scan of a new keyframe."""
        if isinstance(event, KeyframeAdded):
            self.points[event.keyframe] = event.points.astype(np.float64)

    def log_durations(self, durations: Mapping[str, float]) -> None:
        """Keep nothing of them."""

    def close(self) -> None:
        """Keep everything."""


def hits(recording: Path, settings: Sequence[str] = ()) -> Floats:
    """(n, 2) m in `map`: the scans of all keyframes of a replay, at their final poses."""
    scans = KeyframeScans()
    drive = Drive(load_config((), settings), None, scans)
    replayer = PlainReplayer(drive)
    for record in open_recording(recording):
        replayer.play(record)
    return placed(scans.points, drive.finish().building.poses)


def placed(scans: Mapping[int, Floats], poses: Floats) -> Floats:
    """(n, 2) m in `map`: scans in base_link at the (k, 3) poses of their keyframes."""
    return np.concatenate([np.empty((0, 2)), *(Pose2.of(poses[k]).transform(scan) for k, scan in scans.items())])


def wall_area_m2(points: Floats) -> float:
    """The area that `points` (n, 2) m fill: that of exp(H) cells, H being the entropy of the points over the cells.

    A cell with few points counts little, so that single stray hits do not matter. A wall that is drawn twice, apart by
    more than a cell, fills twice the area.
    """
    counts = np.unique(np.floor(points / CELL_M), axis=0, return_counts=True)[1]
    share = counts / counts.sum()
    return float(np.exp(-(share * np.log(share)).sum()) * CELL_M**2)


def main() -> None:
    """Print both areas of a recording."""
    parser = argparse.ArgumentParser(description="The area that the laser's hits fill.")
    parser.add_argument("recording", type=Path)
    parser.add_argument("--set", action="append", default=[], dest="settings", metavar="KEY=VALUE")
    given = parser.parse_args()
    estimated, by_wheels = (
        wall_area_m2(hits(given.recording, [*given.settings, *more])) for more in ((), WHEELS_ALONE)
    )
    print(f"{estimated:.2f} m^2, by the wheels alone {by_wheels:.2f} m^2")  # noqa: T201


if __name__ == "__main__":
    main()
