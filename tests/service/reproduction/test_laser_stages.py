"""Scan matching in close proximity, and LiDAR closures by the estimate."""

import numpy as np
import pytest
from reproduced_drives import drifting, path_of, silent
from rooms import CORRIDOR, HALL, see

from wayfi.backend.pose2 import Floats, Pose2, between_all
from wayfi.frontends.scan_points import ScanPoints
from wayfi.service.reproduction.laser_stages import close_scans, lidar_closures
from wayfi.service.reproduction.wifi_closures import Closures


@pytest.fixture(scope="module")
def hall() -> tuple[Floats, dict[int, ScanPoints]]:
    """Poses along a hall and back, 0.4 m apart, and what the laser sees at all but the third."""
    x = np.concatenate([np.linspace(-4.0, 0.0, 11), np.linspace(0.0, -4.0, 11)])
    poses = np.stack([x, np.repeat([0.0, 0.5], 11), np.zeros(22)], axis=1)
    rng = np.random.default_rng(2)
    return poses, {i: see(HALL, Pose2.of(pose), rng) for i, pose in enumerate(poses) if i != 2}


def errors_of(closures: Closures, truth: Floats) -> tuple[float, float]:
    errors = between_all(between_all(*(truth[closures.pairs[:, end]] for end in (0, 1))), closures.T_a_b)
    return float(np.hypot(*errors[:, :2].T).max()), float(np.abs(errors[:, 2]).max())


def test_scans_within_a_metre_of_path_are_matched(hall: tuple[Floats, dict[int, ScanPoints]]) -> None:
    truth, scans = hall
    path_m = path_of(truth)
    closures = close_scans(scans, drifting(truth, 0.02), path_m, silent)
    near = [(a, b) for a in scans for b in scans if a < b and path_m[b] - path_m[a] <= 1.0]
    assert sorted(map(tuple, closures.pairs.tolist())) == near
    assert errors_of(closures, truth) < (0.03, 0.01)


@pytest.mark.parametrize(("share", "chosen"), [(0.1, [0, 11, 21]), (0.4, [0, 3, 6, 8, 11, 13, 16, 18, 21])])
def test_a_share_of_the_scans_is_matched_with_all_that_the_estimate_puts_near(
    hall: tuple[Floats, dict[int, ScanPoints]], share: float, chosen: list[int]
) -> None:
    truth, scans = hall
    rng = np.random.default_rng(3)
    estimate = truth + rng.normal(0.0, 1.0, truth.shape) * np.array([0.2, 0.2, 0.05])
    path_m, wanted = path_of(truth), []
    for a in scans:
        for b in scans:
            near = np.hypot(*(estimate[a] - estimate[b])[:2]) <= 5.0 and path_m[b] - path_m[a] > 1.0
            if a < b and near and {a, b} & set(chosen):
                wanted.append((a, b))
    closures = lidar_closures(scans, estimate, path_m, share, silent)
    assert set(map(tuple, closures.pairs.tolist())) <= set(wanted)
    assert len(closures) > 0.9 * len(wanted)
    assert errors_of(closures, truth) < (0.05, 0.01)


def test_scans_of_different_places_are_refused() -> None:
    rng = np.random.default_rng(4)
    scans = {0: see(HALL, Pose2(), rng), 1: see(CORRIDOR, Pose2(), rng)}
    far_apart_m = np.array([0.0, 60.0])
    assert len(lidar_closures(scans, np.zeros((2, 3)), far_apart_m, 1.0, silent)) == 0
    scans[1] = see(HALL, Pose2(0.3, 0.2, 0.05), rng)
    assert len(lidar_closures(scans, np.zeros((2, 3)), far_apart_m, 1.0, silent)) == 1


@pytest.mark.parametrize(("apart_m", "found"), [(4.9, 1), (5.1, 0)])
def test_scans_are_matched_up_to_five_metres_apart(apart_m: float, found: int) -> None:
    rng, poses = np.random.default_rng(5), np.array([[-4.0, 0.0, 0.0], [-4.0 + apart_m, 0.0, 0.0]])
    scans = {i: see(HALL, Pose2.of(pose), rng) for i, pose in enumerate(poses)}
    assert len(lidar_closures(scans, poses, np.array([0.0, 60.0]), 1.0, silent)) == found


@pytest.mark.parametrize(("part", "found"), [(0.25, 0), (0.5, 1)])
def test_half_of_the_mean_number_of_points_has_to_match(part: float, found: int) -> None:
    """A quarter of a scan matches the whole in every point: less than half of five eighths."""
    whole = see(HALL, Pose2(), np.random.default_rng(6))
    n = int(part * len(whole.points))
    scans = {0: whole, 1: ScanPoints(whole.points[:n], whole.normals[:n], Pose2())}
    assert len(close_scans(scans, np.zeros((2, 3)), np.array([0.0, 0.5]), silent)) == found
