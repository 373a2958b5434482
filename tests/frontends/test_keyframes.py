"""Which keyframe a moment belongs to."""

import pytest

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.keyframes import Keyframe, Keyframes
from wayfi.frontends.odometry.driven_path import PathPoint


@pytest.mark.parametrize(("stamp_ns", "number"), [(5, 0), (10, 0), (19, 0), (20, 1), (25, 1), (30, 2), (99, 2)])
def test_a_moment_belongs_to_the_newest_keyframe_before_it(stamp_ns: int, number: int) -> None:
    keyframes = Keyframes()
    for k in range(3):
        keyframes.append(Keyframe(PathPoint(10 * (k + 1), Pose2(), 0.5 * k), None))
    assert keyframes.before(stamp_ns) == number
