"""A graph optimised as a whole, in steps of bounded work, and an iSAM2 that starts from the result."""

from collections.abc import Generator, Mapping, Sequence

import gtsam
import numpy as np

from wayfi.backend.graph.axes_chain import AxesChain
from wayfi.backend.graph.balance import BLOCK
from wayfi.backend.graph.batch import optimised
from wayfi.backend.graph.calibration_chain import CalibrationChain
from wayfi.backend.graph.factors import Factor
from wayfi.backend.graph.gtsam_factors import axes_key, calibration_key, pose_key
from wayfi.backend.graph.isam import Isam
from wayfi.backend.pose2 import Floats, Pose2

FED_WORK = 4  # of a factor that iSAM2 takes, which includes preparing and eliminating it
SETTLING_WORK = 1_000_000  # of one settling: it fills an update of its own


class Rebuild:
    """Optimises `factors` by their numbers from `start`: calibrations (k, 4), held fixed meanwhile, and poses (n, 3).

    Then it feeds the result to `isam`, which is new, and lets that settle. `done` tells when it has.
    """

    def __init__(
        self,
        factors: Mapping[int, Factor],
        chains: tuple[CalibrationChain, AxesChain],
        start: tuple[Floats, Floats],
        isam: Isam,
        settle_updates: int,
    ) -> None:
        self.start, self.isam, self.done = start, isam, False
        self._steps = self._rebuild(factors, chains, settle_updates)

    def go_on(self, work: float) -> None:
        """Do steps until `work` is done, which counts as many as factors could be prepared (about 12 us each)."""
        for step in self._steps:
            work -= step
            if work <= 0:
                return
        self.done = True

    def _rebuild(
        self, factors: Mapping[int, Factor], chains: tuple[CalibrationChain, AxesChain], settle_updates: int
    ) -> Generator[int, None, None]:
        calibrations, poses = self.start
        solved = yield from optimised(list(factors.values()), chains, calibrations, poses, self.isam.origin)
        held = gtsam.KeyList()
        axes = map(axes_key, range(chains[1].states))
        for key in [*map(pose_key, range(len(solved))), *map(calibration_key, range(len(calibrations))), *axes]:
            held.push_back(key)
        for block, block_poses in _in_blocks(factors, solved):
            self.isam.start(block, block_poses, calibrations, held)
            yield FED_WORK * len(block)
        for _ in range(settle_updates):
            yield SETTLING_WORK
            if not self.isam.relinearise():
                break


def continued(poses: Floats, steps: Sequence[Pose2]) -> Floats:
    """(n, 3) `poses` of the first keyframes, continued by the last of the `steps` to each from the one before."""
    extended = [Pose2.of(pose) for pose in poses]
    for step in steps[len(extended) :]:
        extended.append(extended[-1] @ step)
    return np.array([pose.array() for pose in extended])


def _in_blocks(
    factors: Mapping[int, Factor], poses: Sequence[Pose2]
) -> list[tuple[dict[int, Factor], dict[int, Pose2]]]:
    """The keyframes in blocks, each with the factors that relate it to itself and to those before it."""
    blocks: list[tuple[dict[int, Factor], dict[int, Pose2]]] = [({}, {}) for _ in range(_block(len(poses) - 1) + 1)]
    for keyframe, pose in enumerate(poses):
        blocks[_block(keyframe)][1][keyframe] = pose
    for number, factor in factors.items():
        blocks[_block(max(factor.a, factor.b))][0][number] = factor
    return blocks


def _block(keyframe: int) -> int:
    """The block of a keyframe, which ends where `balance` has one end."""
    return max(keyframe - 1, 0) // BLOCK
