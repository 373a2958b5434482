"""Keeps iSAM2's Bayes tree shallow, so that updates and covariances cost the same late in a drive as early.

iSAM2 puts every new keyframe on top of its tree, which becomes as deep as the drive is long. Nested dissection (George
1973) of the path makes its depth logarithmic: the middle of a stretch of path separates its halves, and is eliminated
after both. So every `BLOCK` keyframes the newest block is eliminated again in that order, then every `BRANCHES` blocks
the ends of the newest blocks, and so on.
"""

from collections.abc import Iterable

import gtsam

from wayfi.backend.graph.gtsam_factors import axes_key, calibration_key, pose_key

BLOCK = 64  # keyframes: eliminated again in 3 ms, and found in a path of the tree that takes 1 ms
BRANCHES = 8
CALIBRATION_RANK = 4  # a stretch has about 2^4 keyframes, of which each depends on its calibration
AXES_RANK = 6  # and a state of the axes some 2^6
HIGHEST_RANK = 24  # 2^24 keyframes are 8,000 km


def blocks_ending_at(newest: int) -> list[int]:
    """The keyframes to eliminate again as `newest` comes: the block that it ends, and the ends of smaller blocks.

    Empty where it ends none.
    """
    chosen: set[int] = set()
    step = 1
    while newest > 0 and newest % (step * (BRANCHES if chosen else BLOCK)) == 0:
        length = step * (BRANCHES if chosen else BLOCK)
        chosen.update(range(newest - length, newest + 1, step))
        step = length
    return sorted(chosen)


def dissection(keyframes: Iterable[int], stretches: Iterable[int], axes: Iterable[int]) -> gtsam.ISAM2UpdateParams:
    """Eliminate keyframes, calibrations and states of the axes again, the middles of the path after its parts."""
    keys, ranks = gtsam.KeyList(), gtsam.KeyGroupMap()
    for keyframe in keyframes:
        keys.push_back(pose_key(keyframe))
        ranks.insert2(pose_key(keyframe), _rank(keyframe))
    for stretch in stretches:
        keys.push_back(calibration_key(stretch))
        ranks.insert2(calibration_key(stretch), min(_rank(stretch) + CALIBRATION_RANK, HIGHEST_RANK))
    for state in axes:
        keys.push_back(axes_key(state))
        ranks.insert2(axes_key(state), min(_rank(state) + AXES_RANK, HIGHEST_RANK))
    params = gtsam.ISAM2UpdateParams()
    params.extraReelimKeys, params.constrainedKeys = keys, ranks
    return params


def _rank(number: int) -> int:
    """How often `number` can be halved: of 2^r numbers in a row, the one that is halved most separates the others."""
    return (number & -number).bit_length() - 1 if number else HIGHEST_RANK
