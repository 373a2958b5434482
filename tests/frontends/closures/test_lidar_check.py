"""The bounded check of a candidate, and the gates: right places pass, others are refused with their reason."""

import math
from dataclasses import replace

import numpy as np
import pytest
from rooms import CORRIDOR, HALL, LOOK_ALIKE, ROOM_M, TWO_FOLD, see, see_ahead, see_near
from scipy.stats import chi2

from wayfi.backend.pose2 import Floats, Pose2, wrap
from wayfi.frontends.closures.closure_config import ClosureConfig, OverlapConfig
from wayfi.frontends.closures.lidar_check import (
    OPEN_ALONG,
    RIVAL,
    CheckResult,
    Expected,
    check,
    innovation_chi2,
    nearest_candidate,
    update_by_place,
)
from wayfi.frontends.lidar.lidar_config import LidarConfig
from wayfi.frontends.scan_points import ScanPoints
from wayfi.recordings.simulation.surfaces import box

CONFIG, LIDAR = ClosureConfig(), LidarConfig()
OVERLAP = OverlapConfig()
SURE = np.diag([0.1**2, 0.1**2, 0.03**2])
WIDE = np.diag([0.5**2, 0.5**2, 0.1**2])


def checked(
    faces: Floats,
    a: Pose2,
    b: Pose2,
    guess: Pose2,
    covariance: Floats = WIDE,
    seed: int = 0,
    config: ClosureConfig = CONFIG,
) -> CheckResult:
    """A check of the scan at `b` of `faces` in a submap of five scans around `a`."""
    rng = np.random.default_rng(seed)
    ways = [Pose2(0.5 * k, 0.0, 0.0) for k in range(-2, 3)]
    scans = [see(faces, a @ way, rng) for way in ways]
    done = check(
        see(faces, b, rng), scans, np.array([w.array() for w in ways]), Expected(guess, covariance), config, LIDAR
    )
    assert done is not None
    return done


@pytest.mark.parametrize("seed", range(6))
def test_a_place_seen_again_is_found_from_a_metre_off(seed: int) -> None:
    rng = np.random.default_rng(seed)
    a = Pose2(rng.uniform(-2, 1), rng.uniform(-3, 0), rng.uniform(-3, 3))
    T_a_b = Pose2(*rng.uniform(-0.8, 0.8, 2), rng.uniform(-0.7, 0.7))
    guess = Pose2(T_a_b.x + 0.8, T_a_b.y - 0.6, T_a_b.theta + 0.2)
    done = checked(HALL, a, a @ T_a_b, guess, seed=seed)
    assert done.refused == ""
    assert done.T_a_b.distance(T_a_b) < 0.015
    assert abs(wrap(done.T_a_b.theta - T_a_b.theta)) < math.radians(0.2)
    assert done.inlier_ratio > 0.75
    assert done.second_peak < CONFIG.max_second_peak
    assert (np.sqrt(np.diag(done.covariance))[:2] >= CONFIG.sigma_floor_m).all()
    assert innovation_chi2(Expected(done.T_a_b, done.covariance), T_a_b, 0 * WIDE) < 16.27


@pytest.mark.parametrize(("sigma_m", "refused"), [(1.5, RIVAL), (0.5, "")])
def test_a_room_that_looks_alike_is_not_confirmed_where_the_estimate_allows_the_one_next_door(
    sigma_m: float, refused: str
) -> None:
    rng, start, ways = np.random.default_rng(0), Pose2(6.0, 1.0, 0.0), [Pose2(0.5 * k, 0.0, 0.0) for k in range(-3, 4)]
    scans, poses = [see_near(LOOK_ALIKE, start @ way, rng, 6.0) for way in ways], np.array([w.array() for w in ways])
    next_door = see_near(LOOK_ALIKE, start @ Pose2(ROOM_M, 0.0, 0.0), rng, 6.0)
    expected = Expected(Pose2(0.3, 0.0, 0.0), np.diag([sigma_m**2, sigma_m**2, 0.05**2]))
    done = check(next_door, scans, poses, expected, CONFIG, LIDAR)
    assert done is not None
    assert done.T_a_b.distance(Pose2()) < 0.05
    assert done.refused == refused


def test_another_room_is_refused_for_its_walls() -> None:
    rng = np.random.default_rng(0)
    scans = [see(HALL, Pose2(0.5 * k, -2.0, 0.0), rng) for k in range(3)]
    ways = np.array([[0.5 * k, 0.0, 0.0] for k in range(3)])
    other = np.concatenate([box(-1.0, -12.0, 0.7, 2.0), box(0.2, 0.5, 0.5, 1.0)])
    done = check(see(other, Pose2(0.0, -2.0, 0.0), rng), scans, ways, Expected(Pose2(), WIDE), CONFIG, LIDAR)
    assert done is not None
    assert "inlier ratio" in done.refused


@pytest.mark.parametrize("heading", [0.0, math.pi / 4, -math.pi / 4])
def test_a_corridor_is_refused_since_its_walls_leave_it_open_along_them(heading: float) -> None:
    """However a's axes lie: at 45 degrees neither x nor y is as open as the corridor is along its walls, 1 m."""
    a = Pose2(0.0, 0.0, heading)
    T_a_b = a.between(Pose2(0.5, 0.0, heading))
    done = checked(CORRIDOR, a, a @ T_a_b, T_a_b, WIDE, config=replace(CONFIG, max_sigma_m=0.85))
    assert done.refused == "the walls leave the pose open along them"
    assert done.second_peak > CONFIG.max_second_peak


@pytest.mark.parametrize("heading", [0.0, 0.7, math.pi])
def test_walls_that_leave_the_pose_open_along_them_still_tell_the_rest(heading: float) -> None:
    a = Pose2(0.0, 0.3, heading)
    for seed in range(5):
        T_a_b = a.between(Pose2(0.6, -0.2, heading + 0.1))
        guess = T_a_b @ Pose2(0.3, 0.1, 0.05)
        done = checked(CORRIDOR, a, a @ T_a_b, guess, seed=seed)
        across, turned = (a @ done.T_a_b).y + 0.2, wrap(done.T_a_b.theta - T_a_b.theta)
        along = np.array([math.cos(heading), -math.sin(heading)])
        sideways = np.array([math.sin(heading), math.cos(heading)])
        assert done.refused == OPEN_ALONG
        assert done.walls_agree
        assert abs(across) < 0.02
        assert abs(turned) < 0.006
        assert along @ done.covariance[:2, :2] @ along >= CONFIG.open_sigma_m**2
        assert math.sqrt(sideways @ done.covariance[:2, :2] @ sideways) < 0.05


def test_walls_that_run_another_way_do_not_agree() -> None:
    narrow = np.diag([1.0, 0.02**2, 0.005**2])
    turned = checked(CORRIDOR, Pose2(), Pose2(0.5, 0.0, 0.08), Pose2(0.5, 0.0, 0.0), narrow)
    assert not turned.walls_agree
    hall = checked(HALL, Pose2(), Pose2(0.5, 0.0, 0.0), Pose2(0.5, 0.0, 0.0))
    assert not hall.refused
    assert not hall.walls_agree


def test_a_place_out_of_the_ellipse_is_not_looked_for() -> None:
    narrow = np.diag([0.02**2, 0.02**2, 0.01**2])
    done = checked(HALL, Pose2(), Pose2(1.0, 0.0, 0.0), Pose2(), narrow)
    assert done.refused
    assert done.T_a_b.distance(Pose2()) < 0.9


def test_a_room_with_two_ends_alike_is_refused_where_the_heading_is_open() -> None:
    room, wide = TWO_FOLD[:4], ClosureConfig(max_window_rad=3.3)
    rng = np.random.default_rng(1)
    scans = [see(room, Pose2(0.0, 0.0, heading), rng) for heading in (0.0, math.pi)]
    ways, open_heading = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, math.pi]]), np.diag([0.1, 0.1, 2.0])
    done = check(see(room, Pose2(0.2, 0.1, 0.1), rng), scans, ways, Expected(Pose2(), open_heading), wide, LIDAR)
    assert done is not None
    assert "ambiguous" in done.refused


def test_without_points_there_is_nothing_to_check() -> None:
    seen = see(HALL, Pose2(), np.random.default_rng(0))
    empty = ScanPoints(np.empty((0, 2)), np.empty((0, 2)), Pose2())
    assert check(seen, [], np.empty((0, 3)), Expected(Pose2(), WIDE), CONFIG, LIDAR) is None
    assert check(empty, [seen], np.zeros((1, 3)), Expected(Pose2(), WIDE), CONFIG, LIDAR) is None


# Candidates


def line(n: int, spacing_m: float = 1.0) -> tuple[Floats, Floats]:
    """A path up a line and back beside it, 2 m apart: (2n, 3) poses and the (2n,) path."""
    up = np.stack([np.arange(n) * spacing_m, np.zeros(n), np.zeros(n)], axis=1)
    back = np.stack([np.arange(n)[::-1] * spacing_m, np.full(n, 2.0), np.full(n, math.pi)], axis=1)
    poses = np.concatenate([up, back])
    return poses, np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(poses[:, :2], axis=0).T))])


def test_the_nearest_earlier_keyframe_far_along_the_path_is_the_candidate() -> None:
    poses, paths = line(30)
    everywhere = np.ones(60, np.bool_)
    assert nearest_candidate(59, poses, paths, everywhere, CONFIG) == 0
    assert nearest_candidate(45, poses, paths, everywhere, CONFIG) == 14
    assert nearest_candidate(31, poses, paths, everywhere, CONFIG) is None
    assert nearest_candidate(10, poses, paths, everywhere, CONFIG) is None


def test_only_keyframes_with_a_scan_within_the_radius_are_candidates() -> None:
    poses, paths = line(30)
    for first, found in ((2, 2), (4, 4), (5, None)):
        some = np.arange(60) >= first
        assert nearest_candidate(59, poses, paths, some, CONFIG) == found
    assert nearest_candidate(59, poses, paths, np.zeros(60, np.bool_), CONFIG) is None


# Gates


def test_innovations_drawn_from_their_covariances_are_chi2_distributed() -> None:
    rng = np.random.default_rng(0)
    P = np.array([[0.5, 0.1, 0.02], [0.1, 0.3, -0.01], [0.02, -0.01, 0.05]])
    R = np.diag([0.1, 0.2, 0.01])
    draws = rng.multivariate_normal(np.zeros(3), P + R, 4000)
    predicted = Pose2(3.0, -2.0, 3.1)
    measured = [Pose2(3.0 + x, -2.0 + y, wrap(3.1 + t)) for x, y, t in draws]
    full = np.array([innovation_chi2(Expected(predicted, P), m, R) for m in measured])
    for share in (0.5, 0.95):
        assert (full < chi2.ppf(share, 3)).mean() == pytest.approx(share, abs=0.03)


def test_two_places_said_to_be_one_draw_what_is_expected_between_them() -> None:
    loose = Expected(Pose2(10.0, -4.0, 0.3), np.diag([36.0, 36.0, 0.04]))
    place_a, place_b = np.array([0.2, 0.1]), np.array([-0.3, 0.2])
    nearer, disagreement = update_by_place(loose, place_a, place_b, 0.5)
    apart = nearer.T_a_b.transform(place_b[None])[0] - place_a
    assert math.hypot(*apart) < 0.2
    assert disagreement == pytest.approx((10.0**2 + 4.0**2) / 36.25, rel=0.1)
    assert np.linalg.eigvalsh(nearer.covariance)[0] > 0
    assert np.sqrt(np.diag(nearer.covariance))[:2].max() < 0.55
    firm = Expected(Pose2(10.0, -4.0, 0.3), np.diag([1e-4, 1e-4, 1e-6]))
    unmoved, disagreement = update_by_place(firm, place_a, place_b, 0.5)
    assert unmoved.T_a_b.distance(firm.T_a_b) < 0.01
    assert disagreement > CONFIG.gate_chi2


def test_the_gate_lets_the_share_of_true_closures_pass_that_it_names() -> None:
    assert chi2.sf(CONFIG.gate_chi2, 3) == pytest.approx(0.03, rel=0.05)


def come_back(
    faces_then: Floats, faces_now: Floats, covariance: Floats, overlap: OverlapConfig = OVERLAP
) -> CheckResult:
    """The check of a laser that sees 180 degrees, where it comes back looking 115 degrees to the side."""
    a, T_a_b = Pose2(-1.0, -2.0, 0.0), Pose2(0.3, 0.4, 2.0)
    ways = [Pose2(0.5 * k, 0.0, 0.0) for k in range(-2, 3)]
    scans = [see_ahead(faces_then, a @ way, seed) for seed, way in enumerate(ways)]
    scan, poses = see_ahead(faces_now, a @ T_a_b, 9), np.array([way.array() for way in ways])
    done = check(scan, scans, poses, Expected(T_a_b, covariance), replace(CONFIG, overlap=overlap), LIDAR)
    assert done is not None
    return done


def test_a_laser_that_sees_half_of_a_place_closes_a_loop_looking_another_way() -> None:
    done = come_back(HALL, HALL, SURE)
    assert done.inlier_ratio < CONFIG.min_inlier_ratio
    assert done.refused == ""
    assert done.T_a_b.distance(Pose2(0.3, 0.4, 2.0)) < 0.02


def test_an_uncertain_estimate_asks_for_more_of_the_points() -> None:
    assert come_back(HALL, HALL, 25 * SURE).refused.startswith("inlier ratio")


def test_walls_that_were_seen_through_refuse_it() -> None:
    moved_in = np.concatenate([HALL, box(-0.8, 0.5, 1.5, 0.7)])
    few = replace(OVERLAP, min_inlier_ratio=0.1)
    assert "of those in sight" in come_back(HALL, moved_in, SURE, few).refused
    assert come_back(HALL, moved_in, SURE, replace(few, min_agreement=0.1)).refused == ""


def test_a_pose_of_any_heading_asks_for_more_of_the_points() -> None:
    unknown = np.diag([0.1**2, 0.1**2, 1.0])
    assert come_back(HALL, HALL, SURE).refused == ""
    assert "the heading is unknown" in come_back(HALL, HALL, unknown).refused
