"""Why nothing of a sweep is used: in numbers, and with what to set."""

import numpy as np
import pytest

from wayfi.frontends.lasers.unused import why_few_points, why_no_band, why_no_point, why_no_return
from wayfi.frontends.lidar.lidar_config import CloudConfig
from wayfi.frontends.measurements import LaserScan, PointCloud


def scan(*ranges: float, low: float = 0.1, high: float = 30.0) -> LaserScan:
    return LaserScan(0, "laser", np.array(ranges, np.float32), 0.0, 0.1, low, high)


@pytest.mark.parametrize(
    ("seen", "why"),
    [
        (scan(np.inf, np.nan, 0.0), ""),
        (scan(40.0, np.inf, 50.0, high=80.0), "beyond lidar.max_range_m, 25 m (--set lidar.max_range_m=50)"),
        (scan(4.0, 5.0, high=3.0), "they end between 4.00 and 5.00 m, beyond its range_max of 3 m"),
        (scan(4.0, 5.0, low=9.0), "below its range_min of 9 m"),
        (scan(0.01, 28.0), ""),
        (scan(65.535, np.inf, 65.535), ""),
    ],
)
def test_beams_that_are_not_used(seen: LaserScan, why: str) -> None:
    assert why in why_no_return(seen, 25.0)
    assert bool(why) == bool(why_no_return(seen, 25.0))


def test_points_outside_of_the_band() -> None:
    why = why_no_band(np.array([0.0, 0.05, 0.1]), CloudConfig())
    assert "height band, between 0.2 and 1.8 m" in why
    assert "--set lidar.cloud.low_m=-0.05 --set lidar.cloud.high_m=0.15" in why


def test_points_that_are_too_far_or_none() -> None:
    cloud = PointCloud(0, "lidar", np.array([[3000.0, 0.0, 0.0], [0.0, 4000.0, 0.0]], np.float32))
    assert "between 3000.00 and 4000.00 m away, lidar.max_range_m is 25 m" in why_no_point(cloud, 25.0)
    nothing = PointCloud(0, "lidar", np.full((3, 3), np.nan, np.float32))
    assert why_no_point(nothing, 25.0) == "none of its points is finite"
    assert why_no_point(PointCloud(0, "lidar", np.empty((0, 3), np.float32)), 25.0) == "its clouds hold no points"


def test_few_points() -> None:
    assert "20 points are left of the 24" in why_few_points(20, np.ones(24), 30)
    assert "--set lidar.min_points=20" in why_few_points(20, np.ones(24), 30)
    assert "look for what covers it" in why_few_points(0, np.ones(24), 30)
