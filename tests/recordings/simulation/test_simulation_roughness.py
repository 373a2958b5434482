"""Rough recordings: sweeps that take time, what comes back to a real laser, walls and people as they are."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from wayfi.backend.pose2 import Pose2, compose_all
from wayfi.frontends.measurements import LaserScan
from wayfi.recordings.simulation import laser, returns, roughness, surfaces
from wayfi.recordings.simulation.laser import UST_20LX, Sweeps
from wayfi.recordings.simulation.people import people
from wayfi.recordings.simulation.run import EPOCH_NS, T_BASE_LASER, Run, scans, start, stream
from wayfi.recordings.simulation.surfaces import Material, Surfaces
from wayfi.recordings.simulation.worlds import BLUEPRINTS, World

Floats = NDArray[np.float64]

ROOM = surfaces.box(-3.0, -2.0, 5.0, 4.0)


def distances_m(points: Floats, ends: Floats) -> Floats:
    """(n,) from each of `points` (n, 2) to the nearest of the faces (m, 4)."""
    start_xy, along = ends[:, :2], ends[:, 2:] - ends[:, :2]
    to = points[:, None] - start_xy
    share = np.clip((to * along).sum(axis=2) / (along**2).sum(axis=1), 0.0, 1.0)
    return np.asarray(np.hypot(*(to - share[..., None] * along).transpose(2, 0, 1)).min(axis=1))


def made_of(ends: Floats, material: Material) -> Surfaces:
    face = surfaces.still(ends)
    return Surfaces(
        face.ends, face.since_s, face.until_s, face.velocity_xy, np.full(len(ends), material.value, np.int8)
    )


def facing(distance_m: float, half_width_m: float, material: Material) -> Surfaces:
    """A face across the x axis."""
    return made_of(np.array([[distance_m, -half_width_m, distance_m, half_width_m]]), material)


def seen(scene: Surfaces, count: int = 200, seed: int = 0) -> NDArray[np.float32]:
    """(count, beams) what a laser at rest at the origin, looking along x, reports."""
    rng, shape = np.random.default_rng(seed), (count, UST_20LX.beams)
    sweeps = laser.at_once(np.zeros((count, 3)), np.zeros(count))
    luck = rng.random((count, returns.LUCK, shape[1]), dtype=np.float32)
    return returns.scans(scene, sweeps, UST_20LX, rng.standard_normal(shape, dtype=np.float32), luck)


def beams_at(degrees: float) -> int:
    return round((math.radians(degrees) - UST_20LX.angle_min) / UST_20LX.angle_increment)


# The sweep


def swept(scene: Surfaces, first: Pose2, last: Pose2, time_s: float = 0.0) -> Floats:
    """(beams,) ranges of one sweep from `first` to `last`."""
    poses = (first.array()[None], last.array()[None])
    return laser.hits(scene, Sweeps(np.array([time_s]), *poses, UST_20LX.sweep_s), UST_20LX).range_m[0]


def beam_poses(first: Pose2, last: Pose2) -> Floats:
    """(beams, 3) where the laser is at each beam's moment."""
    share = np.linspace(0.0, 1.0, UST_20LX.beams)[:, None]
    return first.array() + share * (last.array() - first.array())


def points(poses: Floats, range_m: Floats) -> Floats:
    bearing = poses[:, 2] + UST_20LX.bearings
    return np.asarray(poses[:, :2] + range_m[:, None] * np.stack([np.cos(bearing), np.sin(bearing)], axis=1))


@pytest.mark.parametrize("turn", [0.0, 0.3, -0.3])
def test_each_beam_is_cast_from_where_the_laser_is_then(turn: float) -> None:
    first, last = Pose2(0.5, -1.0, 0.4), Pose2(0.7, -0.8, 0.4 + turn)
    range_m = swept(surfaces.still(ROOM), first, last)
    assert distances_m(points(beam_poses(first, last), range_m), ROOM).max() < 1e-9
    assert np.isfinite(range_m).all()
    as_if_at_once = points(np.tile(first.array(), (UST_20LX.beams, 1)), range_m)
    assert distances_m(as_if_at_once, ROOM).max() > 0.1


def test_small_faces_are_met_by_all_their_beams_in_a_sweep() -> None:
    """A room in pieces looks like the room."""
    first, last = Pose2(0.5, -1.0, 0.4), Pose2(0.6, -0.9, 0.2)
    corners = np.vstack([np.linspace(face[:2], face[2:], 40, endpoint=False) for face in ROOM])
    pieces = surfaces.still(surfaces.polygon(corners))
    np.testing.assert_allclose(swept(pieces, first, last), swept(surfaces.still(ROOM), first, last), atol=1e-9)


def test_what_moves_goes_on_during_the_sweep() -> None:
    here = Pose2()
    wall = surfaces.moving(np.array([[2.0, -50.0, 2.0, 50.0]]), 0.0, 9.0, velocity_xy=(10.0, 0.0))
    range_m = swept(wall, here, here, time_s=0.1)
    ahead = np.abs(UST_20LX.bearings) < 0.5
    moment_s = 0.1 + UST_20LX.time_increment_s * np.arange(UST_20LX.beams)
    along_x = range_m * np.cos(UST_20LX.bearings)
    np.testing.assert_allclose(along_x[ahead], 2.0 + 10.0 * moment_s[ahead], atol=1e-9)


def test_a_turn_of_the_mirror_takes_25_ms() -> None:
    assert UST_20LX.time_increment_s * 1440 == pytest.approx(0.025)
    assert {scan.time_increment_s for scan in scans(start(World.OFFICE, 0, 0.1))} == {UST_20LX.time_increment_s}
    assert {scan.time_increment_s for scan in scans(start(World.OFFICE, 0, 0.1, rough=False))} == {0.0}


def turning_scans(run: Run, turns_over_rad_s: float) -> list[LaserScan]:
    ends_s = run.length_ns / 1e9
    scan_list = list(scans(run))
    time_s = np.array([(scan.stamp_ns - EPOCH_NS) / 1e9 for scan in scan_list])
    theta = np.unwrap(run.drive.poses(np.minimum(np.stack([time_s, time_s + 0.1]), ends_s).ravel())[:, 2])
    rate = np.abs(np.diff(theta.reshape(2, -1), axis=0)[0]) / 0.1
    return [scan for scan, r in zip(scan_list, rate, strict=True) if r > turns_over_rad_s]


def test_points_of_a_turning_scan_fall_on_the_walls_at_the_stated_times() -> None:
    run = start(World.OFFICE, 0, minutes=2.8)
    turning = turning_scans(run, 0.5)[::5]
    assert len(turning) >= 4
    off: dict[bool, list[float]] = {True: [], False: []}
    for scan in turning:
        first_s, beam = (scan.stamp_ns - EPOCH_NS) / 1e9, np.arange(len(scan.ranges))
        hit = np.isfinite(scan.ranges) & (scan.ranges > 3.0) & (scan.ranges < 10.0)
        for in_time in (True, False):
            moment_s = first_s + in_time * scan.time_increment_s * beam
            poses = compose_all(run.drive.poses(moment_s), T_BASE_LASER.array())
            walls = run.surfaces.where(~run.surfaces.moves).at(first_s)
            off[in_time].append(float(np.median(distances_m(points(poses, scan.ranges)[hit], walls))))
    assert np.mean(off[True]) < 0.012
    assert np.mean(off[False]) > 1.5 * np.mean(off[True])


# What comes back


def test_noise_grows_with_the_range() -> None:
    sigmas = {}
    for distance_m in (1.0, 8.0, 16.0):
        error = seen(facing(distance_m, 0.5, Material.PLAIN))[:, beams_at(0.0)] - distance_m
        assert abs(error.mean()) < 0.01
        sigmas[distance_m] = float(error.std())
    assert sigmas[1.0] == pytest.approx(0.0115, rel=0.2)
    assert sigmas[8.0] > 1.5 * sigmas[1.0]
    assert sigmas[16.0] > 1.2 * sigmas[8.0]


def test_glass_is_seen_at_a_right_angle_and_through_elsewhere() -> None:
    scene = surfaces.join([facing(2.0, 8.0, Material.GLASS), facing(6.0, 20.0, Material.PLAIN)])
    across = np.abs(seen(scene)[:, beams_at(-5.0) : beams_at(5.0)] - 2.0) < 0.1
    assert across.mean() > 0.98
    range_m = seen(scene)[:, beams_at(30.0) : beams_at(50.0)]
    along_x = range_m * np.cos(UST_20LX.bearings[beams_at(30.0) : beams_at(50.0)])
    assert 0.8 < (np.abs(along_x - 6.0) < 0.2).mean() < 0.95
    assert 0.05 < (np.abs(along_x - 2.0) < 0.2).mean() < 0.2


def test_glass_with_nothing_behind_it_returns_little() -> None:
    oblique = seen(facing(2.0, 8.0, Material.GLASS))[:, beams_at(30.0) : beams_at(50.0)]
    assert 0.8 < np.isinf(oblique).mean() < 0.97


def share_back(distance_m: float, degrees: float, material: Material) -> float:
    """How many beams come back from a face that they meet at `distance_m` and `degrees` off the right angle."""
    at = math.radians(degrees)
    along = np.array([math.sin(at), math.cos(at)]) * 0.5
    face = np.array([[distance_m - along[0], -along[1], distance_m + along[0], along[1]]])
    return float(np.isfinite(seen(made_of(face, material))[:, beams_at(0.0)]).mean())


def test_black_paint_is_lost_far_away_and_when_grazed() -> None:
    assert share_back(3.0, 0.0, Material.BLACK) > 0.95
    assert share_back(15.0, 0.0, Material.BLACK) < 0.05
    assert share_back(5.0, 80.0, Material.BLACK) < 0.1
    assert share_back(15.0, 0.0, Material.PLAIN) > 0.95
    assert share_back(5.0, 80.0, Material.PLAIN) > 0.95


def test_edges_mix_pixels_and_flat_walls_do_not() -> None:
    wall = facing(5.0, 1.0, Material.PLAIN)
    edge = surfaces.join([wall, made_of(np.array([[3.0, -0.5, 3.0, 0.0]]), Material.PLAIN)])
    near = slice(beams_at(-2.0), beams_at(2.0))
    between = (seen(edge)[:, near] > 3.15) & (seen(edge)[:, near] < 4.85)
    assert 0.07 < between.any(axis=1).mean() < 0.2
    assert not ((seen(wall)[:, near] < 4.85) | (seen(wall)[:, near] > 5.15)).any()


# The walls


def test_bumps_are_a_centimetre_or_two_and_smooth() -> None:
    wall = surfaces.still(np.array([[0.0, 0.0, 400.0, 0.0]]))
    rough = roughness.roughened(wall, np.random.default_rng(0)).ends
    assert 0.008 < rough[:, 1].std() < 0.02
    np.testing.assert_array_equal(rough[1:, :2], rough[:-1, 2:])
    steps = np.abs(np.diff(rough[:, 1]))
    assert np.quantile(steps, 0.99) < 0.03
    correlation = [np.corrcoef(rough[:-lag, 1], rough[lag:, 1])[0, 1] for lag in (1, 20)]
    assert correlation[0] > 0.7
    assert abs(correlation[1]) < 0.3


def test_the_same_place_is_as_rough_on_the_next_visit() -> None:
    run = start(World.OFFICE, 0, minutes=0.1)
    walls = run.surfaces.where(~run.surfaces.moves & np.isinf(run.surfaces.since_s))
    first, later = (laser.ranges(walls, np.array([[5.0, 0.0, 0.3]]), np.array([t])) for t in (1.0, 1000.0))
    np.testing.assert_array_equal(first, later)


def test_another_seed_has_other_bumps_and_what_moves_has_none() -> None:
    scene = surfaces.join([surfaces.still(ROOM), surfaces.moving(ROOM + 10.0, 0.0, 9.0, (1.0, 0.0))])
    first, other = (roughness.roughened(scene, np.random.default_rng(seed)) for seed in (1, 2))
    assert not np.array_equal(first.ends, other.ends)
    np.testing.assert_array_equal(first.ends[first.moves], ROOM + 10.0)


def test_some_walls_are_glass_some_black_in_patches_of_about_a_metre() -> None:
    wall = surfaces.still(np.array([[0.0, 0.0, 2000.0, 0.0]]))
    material = roughness.roughened(wall, np.random.default_rng(0)).material
    for kind, least, most in ((Material.GLASS, 0.01, 0.08), (Material.BLACK, 0.03, 0.12)):
        is_kind = material == kind
        patches = (np.diff(is_kind.astype(int)) == 1).sum()
        assert least < is_kind.mean() < most
        assert 0.4 < is_kind.sum() * roughness.PIECE_M / patches < 3.0


# The people


def legs(run: Run, world: World) -> Surfaces:
    return people(run.drive, BLUEPRINTS[world].aisle_m, stream(3, "people"))


@pytest.mark.parametrize("world", list(World), ids=str)
def test_people_are_near_the_robot_for_a_while_and_never_on_it(world: World) -> None:
    run = start(world, seed=3)
    walking = legs(run, world)
    times_s = np.arange(0.0, run.length_ns / 1e9, 2.9)
    gaps = []
    for time_s, pose in zip(times_s, run.drive.poses(times_s), strict=True):
        there = walking.at(time_s)
        gaps.append(distances_m(pose[None, :2], there)[0] if len(there) else np.inf)
    assert min(gaps) > 0.25
    assert 0.1 < (np.array(gaps) < 5.0).mean() < 0.7


def test_people_walk_at_a_persons_pace_on_two_legs() -> None:
    run = start(World.CARPARK, seed=3)
    walking = legs(run, World.CARPARK)
    swings = np.hypot(*walking.velocity_xy[walking.moves].T)
    assert np.quantile(swings, 0.99) < 3.5
    assert 1.0 < np.median(swings) < 3.0
    stand = ~walking.moves
    np.testing.assert_allclose((walking.until_s - walking.since_s)[stand], 0.5)
