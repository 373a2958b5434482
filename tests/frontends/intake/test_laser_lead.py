"""The laser leads where no odometry comes: by scans or by clouds, and also after the drive was pickled."""

import pickle
from collections.abc import Callable

import numpy as np
import pytest
from clouds import HALL as SPATIAL_HALL
from clouds import cloud_at
from rooms import HALL

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.measurements import SECOND_NS, LaserScan, StaticTransform, StaticTransforms, Sweep
from wayfi.frontends.pipeline import Pipeline
from wayfi.frontends.slam_config import SlamConfig
from wayfi.recordings.simulation import lidar3d
from wayfi.recordings.simulation.laser import ANGLE_INCREMENT, ANGLE_MIN, ranges
from wayfi.recordings.simulation.surfaces import still

STEP = Pose2(0.05, 0.0, 0.01)
START = Pose2(0.0, -2.5, 0.0)
UPRIGHT = StaticTransform("base_link", "lidar", (0.0, 0.0, lidar3d.HEIGHT_M), (0.0, 0.0, 0.0, 1.0))
SWEEPS = 50


def planar(number: int, pose: Pose2) -> Sweep:
    seen = ranges(still(HALL), (START @ pose).array()[None], np.zeros(1))[0].astype(np.float32)
    return LaserScan(number * SECOND_NS // 10, "base_link", seen, ANGLE_MIN, ANGLE_INCREMENT, 0.05, 30.0)


def spatial(number: int, pose: Pose2) -> Sweep:
    cloud = cloud_at(SPATIAL_HALL, pose, number)
    return type(cloud)(number * SECOND_NS // 10, "lidar", cloud.points)


@pytest.mark.parametrize("sweep", [planar, spatial])
def test_a_drive_that_the_laser_leads_goes_on_after_pickling(sweep: Callable[[int, Pose2], Sweep]) -> None:
    pipeline, pose = Pipeline(SlamConfig()), Pose2()
    pipeline.process(StaticTransforms(0, (UPRIGHT,)))
    for number in range(SWEEPS):
        pose = pose @ STEP
        pipeline.process(sweep(number, pose))
        if number == SWEEPS // 2 + 10:
            pipeline = pickle.loads(pickle.dumps(pipeline))
    result, _ = pipeline.finish()
    assert len(result.final) == SWEEPS
    driven_m = STEP.distance(pose)
    assert Pose2.of(result.final[0]).distance(Pose2.of(result.final[-1])) == pytest.approx(driven_m, abs=0.05)
