"""A match against a submap: open where the walls leave it open, and freed of the prior that guided it."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rooms import CORRIDOR, HALL, see

from wayfi.backend.pose2 import Floats, Pose2, wrap
from wayfi.frontends.lidar.icp import IcpResult
from wayfi.frontends.lidar.laser_points import scan_from_points
from wayfi.frontends.lidar.lidar_config import LidarConfig
from wayfi.frontends.lidar.scan_matching import (
    ScanMatch,
    SubmapRays,
    constrained_directions,
    match_covariance,
    match_scan,
    merge_submap,
    nearly_open,
    without_prior,
)
from wayfi.frontends.scan_points import ScanPoints

LIDAR = LidarConfig()
STEP = Pose2(0.4, 0.0, 0.1)
WHEELS = np.diag([0.05**2, 0.05**2, 0.03**2])
ANGLES = st.floats(-3.1, 3.1)


def matched(faces: Floats, start: Pose2, guess: Pose2, covariance: Floats = WHEELS, seed: int = 0) -> ScanMatch:
    """The scan one step from `start` against that at `start`."""
    rng = np.random.default_rng(seed)
    submap = merge_submap([see(faces, start, rng)], np.zeros((1, 3)), LIDAR.cell_m)
    assert submap is not None
    return match_scan(see(faces, start @ STEP, rng), submap, guess, covariance, LIDAR.search_below, LIDAR, None)


def information(theta: float, along: float, across: float) -> Floats:
    """(3, 3) with `along` in the direction theta and `across` at right angles to it."""
    c, s = np.cos(theta), np.sin(theta)
    R = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    turned: Floats = R @ np.diag([along, across, 1e4]) @ R.T
    return turned


@pytest.mark.parametrize("heading", [0.0, 0.4, 1.5])
def test_a_corridor_leaves_a_match_open_along_it_and_nowhere_else(heading: float) -> None:
    covariance = matched(CORRIDOR, Pose2(0.0, 0.1, heading), STEP).covariance
    along = np.array([np.cos(heading), -np.sin(heading), 0.0])
    across = np.array([np.sin(heading), np.cos(heading), 0.0])
    assert np.sqrt(along @ covariance @ along) == pytest.approx(1.0, abs=0.1)
    assert np.sqrt(across @ covariance @ across) < 0.02
    assert np.sqrt(covariance[2, 2]) < 0.02


def test_a_hall_closes_every_direction() -> None:
    match = matched(HALL, Pose2(0.5, -2.0, 0.3), STEP)
    assert (np.sqrt(np.diag(match.covariance)) < 0.02).all()
    assert match.T_submap_scan.distance(STEP) < 0.01


def test_a_guess_that_is_far_off_is_found_again_by_the_search() -> None:
    match = matched(HALL, Pose2(0.5, -2.0, 0.3), STEP @ Pose2(0.8, -0.7, 0.5), np.diag([0.5**2, 0.5**2, 0.3**2]))
    assert match.T_submap_scan.distance(STEP) < 0.02
    assert abs(wrap(match.T_submap_scan.theta - STEP.theta)) < 0.01


@settings(deadline=None)
@given(ANGLES, st.floats(1.0, 1e6), st.floats(1.0, 1e6))
def test_the_covariance_is_symmetric_and_between_its_floor_and_an_open_direction(
    theta: float, along: float, across: float
) -> None:
    result = IcpResult(Pose2(), information(theta, along, across), 1.0, 0.0)
    covariance = match_covariance(result, LIDAR.degenerate_below, LIDAR.sigma_floor_m, LIDAR.sigma_floor_rad)
    np.testing.assert_array_equal(covariance, covariance.T)
    sigmas = np.sqrt(np.linalg.eigvalsh(covariance[:2, :2]))
    assert (sigmas >= LIDAR.sigma_floor_m * (1 - 1e-9)).all()
    assert (sigmas <= np.hypot(1.0, LIDAR.sigma_floor_m) + 1e-9).all()


@settings(deadline=None)
@given(ANGLES, st.floats(-3, 3))
def test_a_direction_is_kept_or_left_as_a_whole(theta: float, exponent: float) -> None:
    weak = 1e4 * 10.0**exponent
    kept = constrained_directions(information(theta, weak, 1e4), LIDAR.degenerate_below)
    np.testing.assert_allclose(kept @ kept, kept, atol=1e-9)
    ratio = min(weak, 1e4) / max(weak, 1e4)
    assert round(float(np.trace(kept))) == (2 if ratio < LIDAR.degenerate_below else 3) or ratio == pytest.approx(
        LIDAR.degenerate_below
    )


@settings(deadline=None)
@given(st.lists(st.floats(-0.3, 0.3), min_size=6, max_size=6))
def test_without_the_prior_the_pose_is_that_of_the_scan_alone(numbers: list[float]) -> None:
    """The prior draws the scan's pose to the guess by their informations; without it the scan's pose is back."""
    alone, guess = np.array(numbers[:3]), np.array(numbers[3:])
    scan, prior = information(0.3, 1e5, 2e5), np.linalg.inv(WHEELS)
    drawn = np.linalg.solve(scan + prior, scan @ alone + prior @ guess)
    result = IcpResult(Pose2.of(drawn), scan, 1.0, 0.0)
    np.testing.assert_allclose(without_prior(result, Pose2.of(guess), prior, LIDAR).array(), alone, atol=2e-3)


def test_a_submap_without_points_is_none() -> None:
    assert merge_submap([], np.empty((0, 3)), LIDAR.cell_m) is None


def near(pose: Pose2, seed: int) -> ScanPoints:
    """What a laser of 6 m range sees of the bare corridor."""
    seen = see(CORRIDOR, pose, np.random.default_rng(seed), sigma_m=0.02)
    return scan_from_points(seen.points[np.hypot(*seen.points.T) < 6.0], Pose2(), LIDAR)


@pytest.mark.parametrize("protect", [True, False, None])
def test_a_robot_is_not_held_back_in_a_bare_corridor_where_a_scan_fits_better_the_further_back_it_is(
    protect: bool | None,
) -> None:
    """Wheels lead 1 m ahead, and rightly; the search, told of the submap's rays, leaves them alone, even poor ones."""
    scans, poses = [near(Pose2(-0.5 * k, 0.0, 0.0), k) for k in range(8)], -0.5 * np.arange(8.0)[:, None] * [1.0, 0, 0]
    submap = merge_submap(scans, poses, LIDAR.cell_m)
    assert submap is not None
    guess = Pose2(2.0, 0.0, 0.0)
    rays = None if protect is None else SubmapRays(scans, poses, protect)
    match = match_scan(near(guess, 9), submap, guess, WHEELS, 1.0, LIDAR, rays)
    back_m = guess.x - match.T_submap_scan.x
    assert back_m > 0.3 if protect is None else back_m < 0.05


@settings(deadline=None)
@given(st.floats(-3, 3), st.floats(0.001, 0.99))
def test_walls_leave_a_direction_nearly_open_by_its_share_of_the_information(theta: float, share: float) -> None:
    turned = information(theta, share * 1e5, 1e5)
    assert nearly_open(turned, LIDAR) == (share < LIDAR.search.nearly_open) or share == pytest.approx(
        LIDAR.search.nearly_open
    )
