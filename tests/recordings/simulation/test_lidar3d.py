"""The simulated 16-beam LiDAR: each beam ends at what it meets first, at the moment it is fired."""

import numpy as np
import pytest
from clouds import HALL, MOUNT, cloud_at

from wayfi.backend.pose2 import Floats, Pose2, compose_all
from wayfi.frontends.lidar.mount import Mount
from wayfi.frontends.measurements import PointCloud, StaticTransforms
from wayfi.recordings.simulation import lidar3d
from wayfi.recordings.simulation.lidar3d import CEILING_M, COLUMNS, ELEVATIONS, HEIGHT_M, heights, level_distances
from wayfi.recordings.simulation.robots.models import Robot
from wayfi.recordings.simulation.run import mount, start
from wayfi.recordings.simulation.spatial import clouds, spatial_measurements
from wayfi.recordings.simulation.surfaces import Material, Surfaces, box, join, moving, still
from wayfi.recordings.simulation.worlds.blueprints import World

CAR = box(4.0, -2.0, 5.8, 2.0)


def standing(pose: Pose2 = Pose2()) -> Floats:
    return np.tile(pose.array(), (COLUMNS, 1))


def distances(surfaces: Surfaces, poses: Floats) -> Floats:
    return level_distances(surfaces, heights(surfaces), poses, 0.0)


def test_heights_follow_from_the_size_of_a_shape() -> None:
    pillar, person = box(0.0, 5.0, 0.4, 5.4), moving(box(0.0, -5.0, 0.4, -4.6), 0.0, 9.0, (1.0, 0.0))
    world = join([still(np.vstack([box(-20.0, -20.0, 20.0, 20.0), CAR, pillar])), person])
    assert heights(world).reshape(-1, 4).tolist() == [
        [lidar3d.CEILING_M] * 4, [lidar3d.CAR_HEIGHT_M] * 4, [lidar3d.CEILING_M] * 4, [lidar3d.PERSON_HEIGHT_M] * 4
    ]  # fmt: skip


def test_beams_end_at_floor_and_ceiling() -> None:
    level = distances(still(box(-500.0, -500.0, 500.0, 500.0)), standing())
    expected = np.where(ELEVATIONS < 0, -HEIGHT_M, CEILING_M - HEIGHT_M) / np.tan(ELEVATIONS)
    np.testing.assert_allclose(level, np.tile(np.minimum(expected, 500.0), (COLUMNS, 1)))


def test_beams_end_at_the_nearest_of_all_walls() -> None:
    """Against every beam intersected with every face."""
    poses = standing(Pose2(0.3, 0.2, 1.0))
    level = distances(HALL, poses)
    for column in range(0, COLUMNS, 37):
        angle = poses[column, 2] + lidar3d.column_bearings()[column]
        along = np.array([np.cos(angle), np.sin(angle)])
        start_to, face = HALL.ends[:, :2] - poses[column, :2], HALL.ends[:, 2:] - HALL.ends[:, :2]
        across = along[0] * face[:, 1] - along[1] * face[:, 0]
        t = (start_to[:, 0] * face[:, 1] - start_to[:, 1] * face[:, 0]) / across
        s = (start_to[:, 0] * along[1] - start_to[:, 1] * along[0]) / across
        wall = t[(t > 0) & (s >= 0) & (s <= 1)].min()
        assert level[column, 7:9] == pytest.approx(wall)  # one degree up and down: neither floor nor ceiling first


def test_upper_beams_pass_over_a_car_and_all_pass_through_glass() -> None:
    room = still(np.vstack([box(-9.0, -9.0, 9.0, 9.0), CAR]))
    ahead = distances(room, standing())[0]
    z = HEIGHT_M + 4.0 * np.tan(ELEVATIONS)
    over = (z > lidar3d.CAR_HEIGHT_M) & (z < CEILING_M)
    assert over.any()
    assert (ahead[over] > 5.0).all()
    assert ahead[(z >= 0) & (z <= lidar3d.CAR_HEIGHT_M)] == pytest.approx(4.0)
    material = np.where(np.arange(8) < 4, Material.PLAIN, Material.GLASS).astype(np.int8)
    glass = Surfaces(room.ends, room.since_s, room.until_s, room.velocity_xy, material)
    assert distances(glass, standing())[0, 8] == pytest.approx(9.0)


def test_a_moving_sensor_and_a_moving_car_are_met_where_they_are_at_each_column() -> None:
    car = moving(CAR, -5.0, 9.0, (2.0, 1.0))
    time_s = lidar3d.column_times(0.0)
    poses = np.column_stack([0.8 * time_s, 0.3 * time_s, 1.5 * time_s])
    level = distances(car, poses)
    hit = np.flatnonzero(level[:, 8] < 20.0)
    assert len(hit) > 30
    angles = poses[hit, 2] + lidar3d.column_bearings()[hit]
    x = poses[hit, 0] + level[hit, 8] * np.cos(angles) - 2.0 * (time_s[hit] + 5.0)
    y = poses[hit, 1] + level[hit, 8] * np.sin(angles) - 1.0 * (time_s[hit] + 5.0)
    edge = np.minimum.reduce([abs(x - 4.0), abs(x - 5.8), abs(y + 2.0), abs(y - 2.0)])
    assert edge.max() < 1e-9
    for column in hit[[0, -1]]:
        still_there = distances(car, np.tile(poses[column], (COLUMNS, 1)))
        assert np.isfinite(still_there).all()


def test_points_lie_on_the_walls_in_three_dimensions() -> None:
    cloud = cloud_at(HALL, Pose2(), 0)
    height = cloud.points[:, 2] + MOUNT.translation[2]
    assert height.min() == pytest.approx(0.0, abs=0.05)
    assert height.max() == pytest.approx(CEILING_M, abs=0.05)
    assert cloud.points[:, 0].max() == pytest.approx(10.0, abs=0.1)


def test_a_run_gives_the_same_clouds_again_ten_a_second() -> None:
    run = start(World.OFFICE, 3, 0.05)
    first, again = list(clouds(run)), list(clouds(run))
    assert len(first) == 29
    assert all(np.array_equal(a.points, b.points) for a, b in zip(first, again, strict=True))
    assert set(np.diff([c.stamp_ns for c in first])) == {100_000_000}
    assert all(c.time_s is not None and c.time_s.min() >= 0.0 and c.time_s.max() < 0.1 for c in first)


def test_points_deskewed_by_the_truth_fit_the_walls() -> None:
    run = start(World.OFFICE, 0, 0.5, robot=Robot.IDEAL)
    cloud = list(clouds(run))[-1]
    assert cloud.time_s is not None
    since_s = (cloud.stamp_ns - 1_700_000_000_000_000_000) * 1e-9
    poses = compose_all(run.drive.poses(since_s + cloud.time_s.astype(float)), np.array([0.1, 0.0, 0.0]))
    walls = np.flatnonzero((cloud.points[:, 2] > -0.5) & (cloud.points[:, 2] < 1.8))
    flat = np.column_stack([cloud.points[walls, :2], np.zeros(len(walls))]).astype(float)
    xy = compose_all(poses[walls], flat)[:, :2]
    ends = run.surfaces.ends
    along = ends[:, 2:] - ends[:, :2]
    for point in xy[::97]:
        share = ((point - ends[:, :2]) * along).sum(axis=1) / (along**2).sum(axis=1)
        foot = ends[:, :2] + np.clip(share, 0, 1)[:, None] * along
        assert np.hypot(*(point - foot).T).min() < 0.08


def test_a_mount_is_told_with_its_turn() -> None:
    T_base_sensor = Pose2(0.2, -0.1, 2.5)
    (told,) = mount("laser", T_base_sensor, 0.3)
    assert isinstance(told, StaticTransforms)
    sensor = Mount.of(told.transforms[0])
    assert sensor.planar.array() == pytest.approx(T_base_sensor.array())
    assert not sensor.upside_down
    assert sensor.translation.tolist() == [0.2, -0.1, 0.3]


def test_clouds_come_in_place_of_scans() -> None:
    kinds = {type(m).__name__ for m in spatial_measurements(start(World.OFFICE, 0, 0.05))}
    assert kinds == {"StaticTransforms", "Odometry", "PointCloud", "WifiScan"}
    assert isinstance(next(clouds(start(World.OFFICE, 0, 0.05))), PointCloud)
