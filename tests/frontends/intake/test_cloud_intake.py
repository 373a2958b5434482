"""Clouds on their way to a keyframe: mounts of /tf_static, of the configuration, and none."""

import math

import numpy as np
import pytest

from wayfi.backend.pose2 import Floats
from wayfi.frontends.intake.cloud_intake import CloudIntake, cloud_duration_ns, has_return
from wayfi.frontends.intake.mounts import Mounts
from wayfi.frontends.lidar.lidar_config import LidarConfig
from wayfi.frontends.measurements import PointCloud, Transform

BAND = LidarConfig().cloud
MIDDLE_M = 0.5 * (BAND.low_m + BAND.high_m)
ELSEWHERE = Transform("base_link", "lidar", (5.0, 5.0, 0.7), (0.0, 0.0, 0.0, 1.0))


def intake(config: LidarConfig, *known: Transform) -> CloudIntake:
    mounts = Mounts(config)
    assert [mounts.add(transform) for transform in known] == [None] * len(known)
    return CloudIntake(config, mounts)


def cloud(*points: tuple[float, float, float], time_s: Floats | None = None) -> PointCloud:
    return PointCloud(0, "lidar", np.array(points, np.float32), None if time_s is None else time_s.astype(np.float32))


@pytest.mark.parametrize("known", [(), (ELSEWHERE,)])
def test_a_mount_of_the_configuration_goes_first_and_is_at_the_middle_of_the_band(
    known: tuple[Transform, ...],
) -> None:
    points, _ = intake(LidarConfig(mount=[0.3, 0.0, math.pi / 2]), *known).band(cloud((2.0, 0.0, 0.0)))
    np.testing.assert_allclose(points, [[0.3, 2.0, MIDDLE_M]], atol=1e-6)


def test_an_unknown_mount_is_base_link_at_the_middle_of_the_band() -> None:
    points, _ = intake(LidarConfig()).band(cloud((2.0, 0.0, 0.0)))
    np.testing.assert_allclose(points, [[2.0, 0.0, MIDDLE_M]], atol=1e-6)


def test_a_known_mount_is_used_with_its_height() -> None:
    points, _ = intake(LidarConfig(), ELSEWHERE).band(cloud((2.0, 0.0, 0.0)))
    np.testing.assert_allclose(points, [[7.0, 5.0, 0.7]], atol=1e-6)


def test_a_cloud_lasts_until_its_last_point_was_taken() -> None:
    assert cloud_duration_ns(cloud((1, 0, 0), (2, 0, 0), time_s=np.array([0.0, 0.1]))) == pytest.approx(1e8, abs=10)
    assert cloud_duration_ns(cloud((1, 0, 0), time_s=np.array([-0.1]))) == 0
    assert cloud_duration_ns(cloud((1, 0, 0))) == 0


def test_a_cloud_of_rows_that_are_not_finite_has_no_return() -> None:
    assert not has_return(cloud((math.nan, 0, 0), (1, math.inf, 0)))
    assert has_return(cloud((math.nan, 0, 0), (1, 0, 0)))
