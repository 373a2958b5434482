"""Three robots in one building: how accurate the map of each is alone, and in the common map, in one frame.

    python tests/benchmarks/fleet.py WORLD [--seed N] [--kept DIR]

Each robot drives another day of other_worlds.py. Errors are of keyframes; alone, each map is aligned with its own
truth, the common one is aligned once.
"""

import argparse
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from localization.drives import KEPT, Drive, simulated
from results_file import commit, row, say
from sessions import replay

from wayfi.backend.pose2 import Floats, compose_all
from wayfi.frontends.maps.building_map import BuildingMap, MapKeyframe
from wayfi.frontends.merging.common_map import CommonMap, common_map
from wayfi.recordings.map.loading import load_map
from wayfi.service.config import load_config
from wayfi.service.evaluation.trajectory_scores import align

ROBOTS = 3
COLUMNS = ("robot", "alone, m", "keyframes in the common map, m", "its own map where it is told to lie, m")


def rms_m(poses: Floats, true: Floats) -> float:
    """The root mean square distance of positions."""
    return float(np.sqrt(((poses - true)[:, :2] ** 2).sum(axis=1).mean()))


def true_poses(keyframes: Sequence[MapKeyframe], drive: Drive) -> Floats:
    """Where the robot was at keyframes."""
    return drive.truth.at(np.array([keyframe.stamp_ns for keyframe in keyframes]))


def aligned(poses: Floats, true: Floats) -> Floats:
    """Poses in the frame of the truth."""
    return compose_all(align(poses[:, :2], true[:, :2]).array(), poses)


def driven(kept: Path, world: str, seed: int) -> tuple[list[Drive], list[BuildingMap]]:
    """The drives of the robots, and the map of each."""
    drives = [simulated(kept, world, seed, day) for day in range(ROBOTS)]
    folders = [kept / "fleet" / drive.name for drive in drives]
    for drive, folder in zip(drives, folders, strict=True):
        replay(drive, folder, None)
    return drives, [load_map(folder).building for folder in folders]


def errors(drives: Sequence[Drive], maps: Sequence[BuildingMap], common: CommonMap) -> Iterator[list[float]]:
    """Of each robot that was joined, m: alone, in the common map, and as its own map is placed there."""
    truths = [true_poses(own.keyframes, drive) for own, drive in zip(maps, drives, strict=True)]
    joined = [common.poses[str(n)] for n in range(len(maps))]
    T = align(np.concatenate(joined)[:, :2], np.concatenate(truths)[:, :2])
    for n, (own, true) in enumerate(zip(maps, truths, strict=True)):
        placed = compose_all((T @ common.places[str(n)]).array(), own.poses)
        in_common = rms_m(compose_all(T.array(), joined[n]), true)
        yield [rms_m(aligned(own.poses, true), true), in_common, rms_m(placed, true)]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("world", choices=("garage", "office", "warehouse"))
    parser.add_argument("--seed", type=int, default=34)
    parser.add_argument("--kept", type=Path, default=KEPT, help="folder of the drives and results, which are kept")
    asked = parser.parse_args()
    drives, maps = driven(asked.kept, asked.world, asked.seed)
    begun = time.process_time()
    common = common_map({str(n): building for n, building in enumerate(maps)}, load_config())
    say(f"{asked.world}, seed {asked.seed}, at {commit()}: joined in {time.process_time() - begun:.0f} s of CPU")
    say(f"{[len(building.keyframes) for building in maps]} -> {len(common.building.keyframes)} keyframes")
    if common.left_out:
        sys.exit(f"not joined: {dict(common.left_out)}")
    say(row(COLUMNS))
    for n, cells in enumerate(errors(drives, maps, common)):
        say(row([str(n), *(f"{cell:.4f}" for cell in cells)]))


if __name__ == "__main__":
    main()
