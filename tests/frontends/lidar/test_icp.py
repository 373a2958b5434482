"""ICP in rooms with known walls: near the truth where they fix the pose, and honest where they do not."""

import math

import numpy as np
import pytest
from rooms import CORRIDOR, HALL, off_by, see

from wayfi.backend.pose2 import Floats, Pose2, wrap
from wayfi.frontends.lidar.icp import IcpConfig, IcpResult, icp
from wayfi.frontends.lidar.lidar_config import LidarConfig
from wayfi.frontends.lidar.point_index import PointIndex, build_index, nearest
from wayfi.frontends.lidar.scan_matching import match_covariance, match_scan, merge_submap
from wayfi.frontends.scan_points import ScanPoints

LIDAR = LidarConfig()
NO_PRIOR = np.zeros((3, 3))


def submap_at(faces: Floats, poses: list[Pose2], rng: np.random.Generator) -> PointIndex:
    """Scans at `poses`, merged in the frame of the first of them."""
    scans = [see(faces, pose, rng) for pose in poses]
    submap = merge_submap(scans, np.array([poses[0].between(pose).array() for pose in poses]), LIDAR.cell_m)
    assert submap is not None
    return submap


def covariance_of(result: IcpResult) -> Floats:
    return match_covariance(result, LIDAR.degenerate_below, LIDAR.sigma_floor_m, LIDAR.sigma_floor_rad)


def test_known_rooms_are_found_again_to_a_centimetre_from_many_first_guesses() -> None:
    rng = np.random.default_rng(1)
    distances, turns = [], []
    for _ in range(100):
        a = Pose2(rng.uniform(-1.5, 1.5), rng.uniform(-3.0, 1.0), rng.uniform(-3, 3))
        b = a @ Pose2(rng.uniform(0, 0.6), rng.uniform(-0.1, 0.1), rng.uniform(-0.4, 0.4))
        submap = submap_at(HALL, [a, a @ Pose2(-0.5, 0.0, 0.1), a @ Pose2(-1.0, 0.1, 0.2)], rng)
        T_a_b = a.between(b)
        off = off_by(rng, 0.3, 3.0)
        guess = Pose2(T_a_b.x + off.x, T_a_b.y + off.y, T_a_b.theta + off.theta)
        result = icp(see(HALL, b, rng), submap, guess, NO_PRIOR, IcpConfig())
        distances.append(result.T_target_scan.distance(T_a_b))
        turns.append(abs(wrap(result.T_target_scan.theta - T_a_b.theta)))
        assert result.inlier_ratio > 0.8
        assert result.residual_m < 0.03
    assert max(distances) < 0.01
    assert max(turns) < math.radians(0.2)


def test_the_covariance_of_a_match_covers_its_errors() -> None:
    rng = np.random.default_rng(2)
    chi2 = []
    for _ in range(60):
        a = Pose2(rng.uniform(-1, 1), rng.uniform(-2, 0), rng.uniform(-3, 3))
        T_a_b = Pose2(0.4, 0.0, 0.1)
        result = icp(see(HALL, a @ T_a_b, rng), submap_at(HALL, [a], rng), T_a_b, NO_PRIOR, IcpConfig())
        T = result.T_target_scan
        e = np.array([T.x - T_a_b.x, T.y - T_a_b.y, wrap(T.theta - T_a_b.theta)])
        chi2.append(float(e @ np.linalg.solve(covariance_of(result), e)))
    assert np.mean(chi2) < 3.0
    assert np.quantile(chi2, 0.95) < 7.8


@pytest.mark.parametrize("heading", [0.0, 0.7, math.pi / 2, -2.0])
def test_a_corridor_leaves_the_pose_open_along_it(heading: float) -> None:
    rng = np.random.default_rng(3)
    a = Pose2(0.0, 0.2, heading)
    submap = submap_at(CORRIDOR, [a, Pose2(-3.0, 0.1, heading), Pose2(3.0, 0.0, heading)], rng)
    T_a_b = Pose2(0.3, 0.0, 0.05)
    result = icp(see(CORRIDOR, a @ T_a_b, rng), submap, T_a_b, NO_PRIOR, IcpConfig())
    covariance = covariance_of(result)
    along = np.array([math.cos(-heading), math.sin(-heading)])
    across = np.array([-along[1], along[0]])
    sigma_along = math.sqrt(along @ covariance[:2, :2] @ along)
    sigma_across = math.sqrt(across @ covariance[:2, :2] @ across)
    assert sigma_across < 0.02
    assert sigma_along > 8 * sigma_across
    assert math.sqrt(covariance[2, 2]) < 0.01


def test_in_a_corridor_the_prior_decides_along_it_and_the_walls_across() -> None:
    rng = np.random.default_rng(4)
    a = Pose2(0.0, 0.2, 0.0)
    submap = submap_at(CORRIDOR, [a, Pose2(-3.0, 0.1, 0.0), Pose2(3.0, 0.0, 0.0)], rng)
    guess = Pose2(0.45, 0.15, 0.03)
    scan = see(CORRIDOR, a @ Pose2(0.3, 0.0, 0.0), rng)
    match = match_scan(scan, submap, guess, np.diag([0.05**2, 0.2**2, 0.05**2]), 0.0, LIDAR, None)
    assert abs(match.T_submap_scan.x - guess.x) < 0.05
    assert abs(match.T_submap_scan.y) < 0.02
    assert abs(match.T_submap_scan.theta) < 0.005


WALLS = 0.06 * np.arange(-50, 17)  # x, m, of the points that a submap has of a corridor's two walls


def corridor_points(x: Floats, half_width_m: float) -> tuple[Floats, Floats]:
    """Points (2 n, 2) of both walls of a corridor along x at `x` (n,), and their normals."""
    y = np.repeat([half_width_m, -half_width_m], len(x))
    points = np.column_stack([np.tile(x, 2), y])
    return points, np.column_stack([np.zeros(len(y)), -np.sign(y)])


def scan_of(*parts: tuple[Floats, Floats]) -> ScanPoints:
    points, normals = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
    return ScanPoints(points, normals, Pose2())


def test_walls_beyond_the_end_of_what_the_submap_has_seen_do_not_pull() -> None:
    seen, end = corridor_points(WALLS, 1.2), (np.array([[-3.1, 0.0]]), np.array([[1.0, 0.0]]))
    seen[1][[len(WALLS) - 1, -1], 0] = 0.15  # the last line of each wall slants, as where a niche begins
    points, normals = (np.concatenate(arrays) for arrays in zip(seen, end, strict=True))
    target = build_index(points, normals, LIDAR.cell_m)
    niches = corridor_points(WALLS[-1] + np.array([0.07, 0.10, 0.13, 0.16]), 1.3)
    without, result = (
        icp(scan, target, Pose2(), 100.0 * np.eye(3), IcpConfig())
        for scan in (scan_of((points, normals)), scan_of((points, normals), niches))
    )
    np.testing.assert_allclose(result.T_target_scan.array(), without.T_target_scan.array(), atol=1e-9)
    np.testing.assert_allclose(result.information, without.information, atol=1e-9)


def test_walls_between_coarse_beams_count() -> None:
    seen = corridor_points(5.0 * WALLS, 1.2)
    scan = scan_of(corridor_points(5.0 * WALLS[:-1] + 0.14, 1.2))
    result = icp(scan, build_index(*seen, LIDAR.cell_m), Pose2(0.0, 0.05, 0.01), NO_PRIOR, IcpConfig())
    assert abs(result.T_target_scan.y) < 1e-3
    assert abs(result.T_target_scan.theta) < 1e-3
    assert math.sqrt(covariance_of(result)[1, 1]) < 0.01


def test_short_walls_lead_a_guess_that_is_further_off_than_they_are_long() -> None:
    along, across = np.array([0.0, 0.06, 0.12]), np.zeros(3)
    corners = np.array([[3.0, 2.0], [-3.0, 2.0], [3.0, -2.0], [-3.0, -2.0]])  # m, of walls of 12 cm
    faces = np.concatenate([np.column_stack([along, across]), np.column_stack([across, along])])
    points = np.concatenate([corner + np.sign(corner) * faces for corner in corners])
    normals = np.concatenate([-np.sign(corner) * np.repeat([[0.0, 1.0], [1.0, 0.0]], 3, axis=0) for corner in corners])
    target = build_index(points, normals, LIDAR.cell_m)
    result = icp(scan_of((points, normals)), target, Pose2(0.25, 0.2, 0.0), NO_PRIOR, IcpConfig())
    assert math.hypot(result.T_target_scan.x, result.T_target_scan.y) < 0.01


def test_without_overlap_nothing_matches_and_the_guess_stays() -> None:
    rng = np.random.default_rng(5)
    submap = submap_at(HALL, [Pose2()], rng)
    guess = Pose2(200.0, -100.0, 1.0)
    result = icp(see(HALL, Pose2(), rng), submap, guess, NO_PRIOR, IcpConfig())
    assert result.inlier_ratio == 0.0
    assert result.T_target_scan == guess
    np.testing.assert_array_equal(result.information, 0)
    covariance = covariance_of(result)
    assert math.sqrt(covariance[0, 0]) > 0.9
    assert np.linalg.eigvalsh(covariance)[0] > 0


def test_a_scan_without_points_matches_nothing() -> None:
    empty = ScanPoints(np.empty((0, 2)), np.empty((0, 2)), Pose2())
    result = icp(empty, submap_at(HALL, [Pose2()], np.random.default_rng(6)), Pose2(), NO_PRIOR, IcpConfig())
    assert (result.T_target_scan, result.inlier_ratio, result.residual_m) == (Pose2(), 0.0, 0.0)


def test_the_window_is_searched_where_the_guess_is_out_of_reach() -> None:
    rng = np.random.default_rng(7)
    a, T_a_b = Pose2(), Pose2(0.5, 0.0, 0.1)
    submap, scan = submap_at(HALL, [a, Pose2(-0.5, 0.0, 0.0)], rng), see(HALL, a @ T_a_b, rng)
    guess = Pose2(1.3, -0.5, 0.7)
    covariance = np.diag([0.3**2, 0.3**2, 0.3**2])
    assert match_scan(scan, submap, guess, covariance, 0.0, LIDAR, None).T_submap_scan.distance(T_a_b) > 0.1
    match = match_scan(scan, submap, guess, covariance, LIDAR.search_below, LIDAR, None)
    assert match.T_submap_scan.distance(T_a_b) < 0.01
    assert abs(wrap(match.T_submap_scan.theta - T_a_b.theta)) < math.radians(0.2)


def test_nothing_merges_into_no_submap() -> None:
    empty = ScanPoints(np.empty((0, 2)), np.empty((0, 2)), Pose2())
    assert merge_submap([], np.empty((0, 3)), 0.5) is None
    assert merge_submap([empty], np.zeros((1, 3)), 0.5) is None


def test_the_index_finds_the_nearest_point_within_the_gate_as_a_search_of_all_does() -> None:
    rng = np.random.default_rng(8)
    points = rng.uniform(-5, 5, (400, 2))
    index = build_index(points, np.zeros_like(points), 0.5)
    for x, y in rng.uniform(-6, 6, (300, 2)):
        found = nearest(x, y, 0.5, index.points, index.cells)
        distance = np.hypot(*(index.points - [x, y]).T)
        expected = int(np.argmin(distance)) if distance.min() < 0.5 else -1
        assert found == expected


def test_the_index_keeps_every_point_with_its_normal_and_bounds_its_cells() -> None:
    points = np.array([[0.0, 0.0], [1e5, 1e5], [3.0, 4.0]])
    normals = np.array([[1.0, 0.0], [0.0, 1.0], [np.nan, np.nan]])
    index = build_index(points, normals, 0.5)
    assert index.cells.rows * index.cells.columns < 1.1e6
    assert index.cells.starts[-1] == 3
    rows = sorted(map(tuple, np.hstack([index.points, np.nan_to_num(index.normals, nan=9.0)]).tolist()))
    assert rows == [(0.0, 0.0, 1.0, 0.0), (3.0, 4.0, 9.0, 9.0), (1e5, 1e5, 0.0, 1.0)]


def test_one_wall_alone_makes_an_index() -> None:
    wall = np.stack([np.linspace(0, 3, 30), np.zeros(30)], axis=1)
    index = build_index(wall, np.tile([0.0, 1.0], (30, 1)), 0.5)
    assert index.cells.rows * index.cells.columns <= 8
    assert len(index.points) == 30
