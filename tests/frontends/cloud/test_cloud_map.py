"""KISS-ICP's map on level ground: what is put in is found again, near the robot alone, and also after pickling."""

import pickle

import numpy as np
from clouds import HALL, band_at

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.cloud.cloud_map import CloudMap
from wayfi.frontends.lidar.lidar_config import CloudConfig

RANGE_M = 25.0


def hall_map() -> CloudMap:
    cloud_map = CloudMap(CloudConfig(), RANGE_M)
    cloud_map.add(cloud_map.thinned(band_at(HALL, Pose2(), 0)), Pose2())
    return cloud_map


def test_a_cloud_is_found_where_it_was_taken() -> None:
    cloud_map, pose = hall_map(), Pose2(0.1, -0.05, 0.03)
    keypoints = cloud_map.keypoints(cloud_map.thinned(band_at(HALL, pose, 1)))
    assert cloud_map.align(keypoints, Pose2()).distance(pose) < 0.05


def test_what_overlaps_nothing_stays_at_the_guess() -> None:
    cloud_map, guess = hall_map(), Pose2(500.0, 0.0, 1.0)
    found = cloud_map.align(cloud_map.keypoints(cloud_map.thinned(band_at(HALL, Pose2(), 1))), guess)
    np.testing.assert_allclose(found.array(), guess.array())


def test_points_out_of_range_of_the_newest_cloud_are_removed() -> None:
    cloud_map, far = hall_map(), Pose2(200.0, 0.0, 0.0)
    cloud_map.add(cloud_map.thinned(band_at(HALL, Pose2(), 1)), far)
    assert (np.hypot(cloud_map.points()[:, 0] - far.x, cloud_map.points()[:, 1]) < RANGE_M).all()
    cloud_map.clear()
    assert cloud_map.empty


def test_pickling_keeps_the_points() -> None:
    cloud_map = hall_map()
    restored = pickle.loads(pickle.dumps(cloud_map))
    np.testing.assert_array_equal(np.sort(restored.points(), axis=0), np.sort(cloud_map.points(), axis=0))
    assert len(restored.points()) == len(cloud_map.points()) > 0
