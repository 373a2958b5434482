"""The frames as a tree: each once, parents first, and what is missing."""

import numpy as np

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.lidar.lidar_config import LidarConfig
from wayfi.frontends.measurements import LaserScan, Odometry, StaticTransforms, Transform
from wayfi.recordings.inspecting.frames import Frames


def joined(*pairs: tuple[str, str]) -> StaticTransforms:
    return StaticTransforms(0, tuple(Transform(*pair, (0.1, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)) for pair in pairs))


def scan(frame: str) -> LaserScan:
    return LaserScan(0, frame, np.ones(10, np.float32), 0.0, 0.1, 0.1, 10.0)


def test_every_frame_is_there_once_below_its_parent() -> None:
    frames = Frames(LidarConfig(), "")
    frames.add(joined(("mast", "laser"), ("base_link", "mast"), ("base_link", "wheel"), ("gripper", "finger")))
    frames.add(Odometry(0, Pose2(), child_frame_id="/base_link"))
    frames.add(scan("/laser"))
    frames.add(scan("elsewhere"))
    found = frames.inspection()
    assert [(f.frame, f.parent, f.depth) for f in found] == [
        ("base_link", "", 0),
        *(("mast", "base_link", 1), ("laser", "mast", 2), ("wheel", "base_link", 1)),
        *(("gripper", "", 0), ("finger", "gripper", 1), ("elsewhere", "", 0)),
    ]
    assert {f.frame: f.of for f in found if f.of} == {"base_link": "odometry", "laser": "laser", "elsewhere": "laser"}
    (missing,) = frames.missing()
    assert "no transform leads from 'base_link' to 'elsewhere'" in missing


def test_a_base_that_is_set_counts_and_transforms_that_cannot_be_are_told() -> None:
    frames = Frames(LidarConfig(), "chassis")
    frames.add(Odometry(0, Pose2(), child_frame_id="base_link"))
    frames.add(joined(("chassis", "laser"), ("laser", "laser")))
    assert [(f.frame, f.of) for f in frames.inspection()] == [("chassis", "odometry"), ("laser", "")]
    (told,) = frames.missing()
    assert "from 'laser' to 'laser' is not used" in told
