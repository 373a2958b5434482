"""Odometry from scans alone: KISS-ICP's own poses to the last bit, whatever the environment holds."""

import os
import pickle
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from kiss_icp.config.parser import load_config
from kiss_icp.kiss_icp import KissICP
from rooms import HALL, see

from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.lidar.laser_odometry import LaserOdometry
from wayfi.frontends.lidar.lidar_config import LidarConfig

CONFIG = LidarConfig()
STEP = Pose2(0.08, 0.0, 0.02)
HOSTILE = {
    "kiss_icp_mapping": '{"max_points_per_voxel": 1, "voxel_size": 3.0}',
    "KISS_ICP_REGISTRATION": '{"max_num_iterations": 1}',
    "kiss_icp_adaptive_threshold": '{"fixed_threshold": 0.01}',
    "kiss_icp_data": "nonsense",
}
IN_A_HOSTILE_ENVIRONMENT = """
import sys
import wayfi.frontends.pipeline
assert not {"pydantic", "pydantic_settings"} & set(sys.modules), "a settings library was loaded"
import numpy as np
from wayfi.frontends.lidar.laser_odometry import LaserOdometry
from wayfi.frontends.lidar.lidar_config import LidarConfig
odometry = LaserOdometry(LidarConfig())
for points in np.load(sys.argv[1]).values():
    print(*map(float.hex, odometry.match(points).array().tolist()))
"""


def scans(count: int) -> list[Floats]:
    """What a laser sees on a bend through the hall."""
    rng, pose, seen = np.random.default_rng(0), Pose2(-4.0, -2.0, 0.0), []
    for _ in range(count):
        seen.append(see(HALL, pose, rng).points)
        pose = pose @ STEP
    return seen


def own_poses(seen: list[Floats]) -> list[Pose2]:
    """The poses that KISS-ICP's own class gives with the same settings."""
    config = load_config(None)
    config.data.max_range, config.data.deskew = CONFIG.max_range_m, False
    config.mapping.voxel_size = CONFIG.lead_voxel_m
    config.registration.max_num_threads = 1
    kiss, poses = KissICP(config=config), []
    for points in seen:
        kiss.register_frame(np.column_stack([points, np.zeros(len(points))]), np.zeros(len(points)))
        poses.append(Pose2.in_plane(kiss.last_pose))
    return poses


def test_the_poses_are_those_of_kiss_icp_and_near_the_truth() -> None:
    seen = scans(40)
    odometry, true = LaserOdometry(CONFIG), Pose2()
    for points, own in zip(seen, own_poses(seen), strict=True):
        found = odometry.match(points)
        assert found == own
        assert found.distance(true) < 0.05
        true = true @ STEP


def test_the_environment_decides_nothing(tmp_path: Path) -> None:
    seen = scans(10)
    np.savez(tmp_path / "scans.npz", *seen)
    command = [sys.executable, "-c", IN_A_HOSTILE_ENVIRONMENT, tmp_path / "scans.npz"]
    run = subprocess.run(command, env=os.environ | HOSTILE, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    odometry = LaserOdometry(CONFIG)
    here = [" ".join(map(float.hex, odometry.match(points).array().tolist())) for points in seen]
    assert run.stdout.splitlines() == here


def test_it_goes_on_where_it_was_after_pickling() -> None:
    seen = scans(20)
    whole, first = LaserOdometry(CONFIG), LaserOdometry(CONFIG)
    for points in seen[:10]:
        whole.match(points)
        first.match(points)
    restored = pickle.loads(pickle.dumps(first))
    for points in seen[10:]:
        np.testing.assert_allclose(restored.match(points).array(), whole.match(points).array(), atol=1e-6)


def test_a_scan_without_points_leaves_it_on_its_way() -> None:
    odometry = LaserOdometry(CONFIG)
    for points in scans(10):
        before = odometry.match(points)
    assert odometry.match(np.empty((0, 2))).distance(before) == pytest.approx(STEP.x, abs=0.05)


def test_a_step_that_others_know_is_looked_for_first() -> None:
    """Racks that repeat every metre: from a step of 0.9 m the nearest fit would be the rack behind."""
    racks = np.stack(np.meshgrid(np.arange(-15.0, 16.0), [-1.5, 1.5]), axis=-1).reshape(-1, 2)
    step = Pose2(0.9, 0.0, 0.0)
    for expected in (False, True):
        odometry = LaserOdometry(CONFIG)
        odometry.match(racks)
        if expected:
            odometry.expect(step)
        found = odometry.match(step.inverse().transform(racks))
        assert (found.distance(step) < 0.1) == expected
