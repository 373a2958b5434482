"""Many days in one building: what a map grows by, what a message costs, and how accurate each day is.

    python tests/benchmarks/sessions.py WORLD [--seed N] [--days D] [--kept DIR]

The first day's replay makes the map; each further day (other_worlds.py --session) goes on with the map of the day
before, as `wayfi replay --map` does. Accuracy is in the frame of the first day, which that day's truth places once:
no later day is aligned. Milliseconds are of a message's way through the pipeline.
"""

import argparse
import json
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from localization.drives import KEPT, Drive, simulated
from results_file import commit, row, say

from wayfi.backend.pose2 import Pose2, compose_all
from wayfi.recordings.files.map_folder import MANIFEST
from wayfi.recordings.files.replaced_together import current
from wayfi.recordings.files.tum import read_tum
from wayfi.recordings.map.loading import map_folder
from wayfi.recordings.map.manifest import read_manifest
from wayfi.recordings.trajectory import Trajectory
from wayfi.service.evaluation.trajectory_scores import absolute_error

COLUMNS = (
    "day", "found after, s", "final / online ATE, m", "keyframes", "fingerprints", "factors", "map, MB", "peak MB",
    "message p50 / p99 / max, ms",
)  # fmt: skip


def replay(drive: Drive, out: Path, former: Path | None) -> None:
    """Replay a day in a process of its own, on the map of the day before."""
    command = [sys.executable, "-m", "wayfi.service.cli", "replay", str(drive.recording), "--out", str(out)]
    subprocess.run([*command, "--no-rrd", "--quiet", *(("--map", str(former)) if former else ())], check=True)


def placed_by_truth(out: Path, drive: Drive) -> Pose2:
    """The frame of a day's map in that of its truth."""
    return absolute_error(read_tum(out / "trajectory.tum"), drive.truth).T_reference_estimate


def error_m(estimate: Trajectory, truth: Trajectory, T_truth_map: Pose2) -> float:
    """The root mean square error of an estimate in the frame of the map, at its own stamps."""
    apart = compose_all(T_truth_map.array(), estimate.poses)[:, :2] - truth.at(estimate.stamps_ns)[:, :2]
    return float(np.sqrt((apart**2).sum(axis=1).mean()))


def cells(day: int, out: Path, drive: Drive, T_truth_map: Pose2) -> Sequence[str]:
    """The row of one day."""
    final, online = read_tum(out / "trajectory.tum"), read_tum(out / "online.tum", may_be_empty=True)
    report = json.loads((out / "report.json").read_text())
    folder, stage = map_folder(out), report["stages"]["process"]
    counts = read_manifest(folder).counts
    size_mb = sum(path.stat().st_size for path in current(folder, MANIFEST).parent.iterdir()) / 1e6
    errors = [f"{error_m(poses, drive.truth, T_truth_map):.4f}" if len(poses) else "-" for poses in (final, online)]
    found_s = f"{(online.stamps_ns[0] - final.stamps_ns[0]) / 1e9:.1f}" if len(online) else "never"
    return (
        str(day), found_s, " / ".join(errors),
        *(str(counts[name]) for name in ("keyframes", "fingerprints", "factors")), f"{size_mb:.1f}",
        f"{report['peak_memory_mb']:.0f}",
        f"{stage['p50_ms']:.2f} / {stage['p99_ms']:.1f} / {stage['max_ms']:.0f}",
    )  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("world", choices=("garage", "office", "warehouse"))
    parser.add_argument("--seed", type=int, default=34)
    parser.add_argument("--days", type=int, default=20)
    parser.add_argument("--kept", type=Path, default=KEPT, help="folder of the drives and results, which are kept")
    asked = parser.parse_args()
    say(f"{asked.world}, seed {asked.seed}, at {commit()}")
    say(row(COLUMNS))
    former, T_truth_map = None, None
    for day in range(asked.days):
        drive = simulated(asked.kept, asked.world, asked.seed, day)
        out = asked.kept / "sessions" / f"{asked.world}-{asked.seed}-{day}"
        replay(drive, out, former)
        T_truth_map = T_truth_map or placed_by_truth(out, drive)
        say(row(cells(day, out, drive, T_truth_map)))
        former = out


if __name__ == "__main__":
    main()
