"""The paper's Algorithm 1: the law of each of its stages, on small drives with known truth."""

from pathlib import Path

import numpy as np
import pytest
from drives import SECOND_NS, Arrival, write
from hypothesis import given, settings
from hypothesis import strategies as st
from rooms import CORRIDOR, HALL, see

from wayfi.backend.pose2 import Floats, Pose2, between_all, compose_all, wrap
from wayfi.frontends.measurements import LaserScan, Measurement, Odometry, WifiScan
from wayfi.frontends.scan_points import ScanPoints
from wayfi.frontends.wifi.readings import Readings
from wayfi.recordings.trajectory import Trajectory
from wayfi.service.evaluation.trajectory_scores import absolute_error
from wayfi.service.reproduction.batch_graph import STEP_SIGMAS, optimise
from wayfi.service.reproduction.errors import ReproductionError
from wayfi.service.reproduction.laser_stages import close_scans, lidar_closures
from wayfi.service.reproduction.recorded_drive import RecordedDrive, read_drive
from wayfi.service.reproduction.rigid_motion import mean_residual, rigid_motion
from wayfi.service.reproduction.similarities import Similarities, all_similarities
from wayfi.service.reproduction.similarity_model import Distances, SimilarityModel, distance_closures, learn_model
from wayfi.service.reproduction.wifi_closures import Closures, candidate_pairs, sequence_closures

POSES = st.builds(Pose2, st.floats(-50, 50), st.floats(-50, 50), st.floats(-3, 3))
NO_CLOSURES = Closures(np.zeros((0, 2), np.int64), np.zeros((0, 3)))


def silent(fraction: float) -> None:
    pass


def readings(rssi_dbm: Floats, least_dbm: float = -90.0) -> Readings:
    """A scan that hears access point i at `rssi_dbm[i]`, if that is strong enough."""
    heard = np.flatnonzero(rssi_dbm >= least_dbm)
    bssids = tuple(f"02:00:00:00:00:{i:02x}" for i in heard)
    return Readings(bssids, rssi_dbm[heard].astype(np.float32), np.zeros(len(heard), np.float32))


def radio(places: Floats) -> list[Readings]:
    """What is heard at (n, 2) m places of 40 access points that fade evenly with distance."""
    points = np.random.default_rng(0).uniform(-10, 35, (40, 2))
    distance = np.hypot(*(places[:, None] - points[None]).transpose(2, 0, 1))
    return [readings(row) for row in -35.0 - 30.0 * np.log10(1.0 + distance)]


def ring(laps: float, step_m: float = 0.5) -> Floats:
    """(n, 3) poses on a rectangle of 24 x 12 m, 72 m around."""
    s = np.arange(0.0, laps * 72.0, step_m) % 72.0
    ends_m, turns = [0.0, 24.0, 36.0, 60.0, 72.0], [0.0, 0.5, 1.0, 1.5]
    x = np.interp(s, ends_m, [0.0, 24.0, 24.0, 0.0, 0.0])
    y = np.interp(s, ends_m, [0.0, 0.0, 12.0, 12.0, 0.0])
    side = np.clip(np.searchsorted(ends_m, s, side="right") - 1, 0, 3)
    return np.stack([x, y, np.array([wrap(turns[i] * np.pi) for i in side])], axis=1)


def drifting(poses: Floats, turn_rad_per_step: float) -> Floats:
    """What wheels make of `poses` that turn by themselves."""
    steps = between_all(poses[:-1], poses[1:]) + np.array([0.0, 0.0, turn_rad_per_step])
    drifted = [poses[0]]
    for step in steps:
        drifted.append(compose_all(drifted[-1], step)[0])
    return np.array(drifted)


def path_of(poses: Floats) -> Floats:
    return Trajectory(np.arange(len(poses)), poses).path_m()


def alike(places_a: Floats, places_b: Floats, reach_m: float = 1.5) -> Similarities:
    """(n, m) similarity that fades with the distance of the true places."""
    distance2 = ((places_a[:, None, :2] - places_b[None, :, :2]) ** 2).sum(axis=2)
    return np.exp(-0.5 * distance2 / reach_m**2).astype(np.float32)


def trajectory(poses: Floats) -> Trajectory:
    return Trajectory(np.arange(len(poses), dtype=np.int64) * SECOND_NS, poses)


# The motion between two sequences of places


@settings(deadline=None)
@given(POSES, st.integers(0, 2**31), st.integers(2, 30))
def test_a_rigid_motion_is_recovered(T: Pose2, seed: int, n: int) -> None:
    source = np.random.default_rng(seed).uniform(-10, 10, (n, 2))
    found = rigid_motion(source, T.transform(source))
    assert Pose2.of(found).distance(T) < 1e-6
    assert abs(wrap(found[2] - T.theta)) < 1e-6
    assert mean_residual(found, source, T.transform(source)) < 1e-6


def test_no_motion_fits_noisy_points_better_than_the_one_found() -> None:
    rng = np.random.default_rng(0)
    source = rng.uniform(-5, 5, (30, 2))
    target = Pose2(1.0, 2.0, 0.5).transform(source) + rng.normal(0, 0.3, source.shape)
    T = rigid_motion(source, target)

    def cost(dx: float = 0.0, dy: float = 0.0, dtheta: float = 0.0) -> float:
        moved = Pose2.of(T + np.array([dx, dy, dtheta])).transform(source)
        return float(((moved - target) ** 2).sum())

    for e in (-1e-3, 1e-3):
        assert cost() < min(cost(dx=e), cost(dy=e), cost(dtheta=e))


def test_the_residual_is_the_mean_distance_that_is_left() -> None:
    source = np.array([[0.0, 0.0], [1.0, 0.0]])
    assert mean_residual(np.array([0.0, 3.0, np.pi / 2]), source, np.zeros((2, 2))) == pytest.approx((3.0 + 4.0) / 2)


# Similarities and candidates


def test_similarity_is_symmetric_one_with_itself_and_falls_with_distance() -> None:
    similarity = all_similarities(radio(ring(1)[:, :2]), silent)
    np.testing.assert_array_equal(similarity, similarity.T)
    np.testing.assert_array_equal(np.diag(similarity), 1.0)
    assert similarity.min() >= 0.0
    near, further, far = (float(np.mean([similarity[i, i + k] for i in range(60)])) for k in (1, 6, 20))
    assert near > further > far


def test_a_candidate_is_the_most_similar_fingerprint_fifty_metres_before() -> None:
    truth = ring(2)
    similarity, path_m = all_similarities(radio(truth[:, :2]), silent), path_of(truth)
    pairs = candidate_pairs(similarity, path_m)
    expected = []
    for b in range(len(truth)):
        before = [a for a in range(b) if path_m[b] - path_m[a] >= 50.0 and similarity[a, b] >= 0.3]
        if before:
            expected.append((max(before, key=lambda a: similarity[a, b]), b))
    assert pairs.tolist() == [list(pair) for pair in expected]
    assert len(pairs) > 72  # the second lap repeats the first
    assert np.median(np.hypot(*(truth[pairs[:, 0], :2] - truth[pairs[:, 1], :2]).T)) == 0.0


def test_a_drive_that_never_comes_back_has_no_candidate() -> None:
    straight = np.stack([np.arange(300) * 0.5, np.zeros(300), np.zeros(300)], axis=1)
    assert candidate_pairs(alike(straight, straight), path_of(straight)).shape == (0, 2)


@pytest.mark.parametrize(("similar", "found"), [(0.29, 0), (0.31, 1)])
def test_a_candidate_is_similar_to_three_tenths_at_least(similar: float, found: int) -> None:
    similarity = np.array([[1.0, similar], [similar, 1.0]], np.float32)
    assert len(candidate_pairs(similarity, np.array([0.0, 60.0]))) == found


# Sequence closures


def two_passes(drift: Pose2, backwards: bool, offset_m: float = 0.0) -> tuple[Floats, Floats, int]:
    """True poses of two passes around one corner, what odometry makes of them, and the number in a pass."""
    first = ring(1)[30:80]
    second = ring(1, 0.25)[60 + round(4 * offset_m) : 160 + round(4 * offset_m) : 2]
    if backwards:
        second = second[::-1] + np.array([0.0, 0.0, np.pi])
    return np.concatenate([first, second]), np.concatenate([first, compose_all(drift.array(), second)]), len(first)


@pytest.mark.parametrize("backwards", [False, True])
def test_the_pose_between_two_passes_is_recovered(backwards: bool) -> None:
    truth, poses, n = two_passes(Pose2(7.0, -3.0, 0.6), backwards)
    pairs = np.array([(i, 2 * n - 1 - i if backwards else n + i) for i in (22, 27)])
    closures = sequence_closures(pairs, alike(truth, truth, 0.1), poses, 40, 1)
    assert closures.pairs.tolist() == pairs.tolist()
    errors = between_all(between_all(truth[pairs[:, 0]], truth[pairs[:, 1]]), closures.T_a_b)
    np.testing.assert_allclose(errors, 0.0, atol=1e-6)


def test_two_neighbours_give_the_place_between_them() -> None:
    """The second pass stops halfway between the stops of the first: one neighbour is a quarter of a metre off."""
    truth, poses, n = two_passes(Pose2(7.0, -3.0, 0.6), False, 0.25)
    similarity = alike(truth, truth, 0.2)
    pair = np.array([[8, n + 8]])
    true = between_all(truth[pair[:, 0]], truth[pair[:, 1]])
    found = [sequence_closures(pair, similarity, poses, 14, k).T_a_b for k in (1, 2)]
    one, two = (float(np.hypot(*between_all(true, T)[0, :2])) for T in found)
    assert two < 0.02
    assert one > 0.2


def test_a_window_is_of_w_fingerprints_around_each() -> None:
    truth, poses, n = two_passes(Pose2(7.0, -3.0, 0.6), False)
    similarity, pair = alike(truth, truth), np.array([[25, n + 25]])
    found = sequence_closures(pair, similarity, poses, 20, 2).T_a_b
    outside = np.ones(len(poses), bool)
    outside[[*range(15, 36), *range(n + 15, n + 36)]] = False
    elsewhere = poses + 3.0 * outside[:, None]
    np.testing.assert_array_equal(sequence_closures(pair, similarity, elsewhere, 20, 2).T_a_b, found)
    for edge in (15, 35, n + 15, n + 35):
        bent = poses.copy()
        bent[edge, :2] += 3.0
        assert not np.array_equal(sequence_closures(pair, similarity, bent, 20, 2).T_a_b, found)


def test_sequences_that_do_not_fit_are_refused() -> None:
    truth, poses, n = two_passes(Pose2(7.0, -3.0, 0.6), False)
    shuffled = poses.copy()
    shuffled[n:] = np.random.default_rng(1).permutation(poses[n:])
    pair = np.array([[25, n + 25]])
    assert len(sequence_closures(pair, alike(truth, truth), poses, 40, 2)) == 1
    assert len(sequence_closures(pair, alike(truth, truth), shuffled, 40, 2)) == 0


def test_sequences_with_nothing_in_common_are_refused() -> None:
    poses = ring(1)
    assert len(sequence_closures(np.array([[0, 100]]), np.zeros((144, 144), np.float32), poses, 80, 2)) == 0


# The graph


def test_without_closures_the_odometry_stays() -> None:
    poses = drifting(ring(1.5), 0.01)
    np.testing.assert_allclose(optimise(poses, [NO_CLOSURES]), poses, atol=1e-6)


def test_true_closures_straighten_a_drive() -> None:
    truth = ring(2)
    poses = drifting(truth, 0.01)
    pairs = np.array([(i, i + 144) for i in range(144)])
    closures = Closures(pairs, between_all(truth[pairs[:, 0]], truth[pairs[:, 1]]))
    before, after = (
        absolute_error(trajectory(p), trajectory(truth)).error.ate_rmse_m for p in (poses, optimise(poses, [closures]))
    )
    assert after < 0.2 * before


def test_a_closure_has_the_identity_for_a_covariance() -> None:
    """Between two poses that the wheels put 1 m apart: the mean of both, weighted by their information."""
    poses = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    closures = Closures(np.array([[0, 1]]), np.array([[3.0, 0.0, 0.0]]))
    wheels_weigh = 1.0 / STEP_SIGMAS[0] ** 2
    expected = (wheels_weigh * 1.0 + 1.0 * 3.0) / (wheels_weigh + 1.0)
    np.testing.assert_allclose(optimise(poses, [closures])[1], [expected, 0.0, 0.0], atol=1e-6)


def test_a_known_distance_brings_two_poses_so_far_apart() -> None:
    poses = drifting(ring(2), 0.01)
    stated = Distances(np.array([[0, 144]]), np.array([2.0]), np.array([0.01]))
    estimate = optimise(poses, [], stated)
    assert np.hypot(*(poses[144] - poses[0])[:2]) > 5.0
    assert np.hypot(*(estimate[144] - estimate[0])[:2]) == pytest.approx(2.0, abs=0.05)


# The similarity model


def test_the_more_alike_two_fingerprints_are_the_nearer_they_stand() -> None:
    truth = ring(2)
    similarity = all_similarities(radio(truth[:, :2]), silent)
    model = learn_model(similarity, truth, path_of(truth))
    assert len(model.similarity) > 8
    assert (np.diff(model.similarity) > 0).all()
    assert (np.diff(model.distance_m) < 0).all()
    assert (model.sigma_m > 0).all()


def test_the_model_is_learnt_over_short_distances_alone() -> None:
    """The second lap of the odometry is far from the first, which is as similar as can be."""
    truth = ring(2)
    similarity = all_similarities(radio(truth[:, :2]), silent)
    torn = truth + np.array([1000.0, 0.0, 0.0]) * (np.arange(len(truth)) >= 144)[:, None]
    assert learn_model(similarity, torn, path_of(torn)).distance_m.max() < 20.0


def test_between_its_bins_the_model_is_interpolated() -> None:
    model = SimilarityModel(np.array([0.2, 0.6]), np.array([8.0, 2.0]), np.array([3.0, 1.0]))
    similarity = np.array([[1.0, 0.4, 0.9], [0.4, 1.0, 0.0], [0.9, 0.0, 1.0]], np.float32)
    found = distance_closures(np.array([(0, 1), (0, 2), (1, 2)]), similarity, model)
    np.testing.assert_allclose(found.distance_m, [5.0, 2.0, 8.0], atol=1e-6)
    np.testing.assert_allclose(found.sigma_m, [2.0, 1.0, 3.0], atol=1e-6)


def test_of_three_fingerprints_no_model_is_learnt() -> None:
    with pytest.raises(ReproductionError, match="too few"):
        learn_model(np.eye(3, dtype=np.float32), ring(1)[:3], np.arange(3.0))


# The laser's stages


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


# A recording as a batch method takes it


def arrivals(*measurements: Measurement) -> list[Arrival]:
    return [Arrival(m.stamp_ns, m) for m in measurements]


def wheels(seconds: int, speed_m_s: float = 0.5) -> list[Arrival]:
    """Straight on, ten times a second."""
    return arrivals(*(Odometry(t * SECOND_NS // 10, Pose2(speed_m_s * t / 10, 0.0, 0.0)) for t in range(10 * seconds)))


def wifi_scan(second: float, age_s: float = 0.0, rssi: float = -50.0) -> WifiScan:
    bssids = ("02:00:00:00:00:01", "02:00:00:00:00:02")
    levels = np.full(2, rssi, np.float32)
    return WifiScan(round(second * SECOND_NS), "phone", bssids, levels, np.full(2, age_s, np.float32))


def laser_scan(second: float) -> LaserScan:
    """A wall 4 m ahead of the place where the scan is taken."""
    ranges = (4.0 / np.cos(np.linspace(-0.5, 0.5, 101))).astype(np.float32)
    return LaserScan(round(second * SECOND_NS), "base_link", ranges, -0.5, 0.01, 0.1, 20.0)


def drive_of(tmp_path: Path, received: list[Arrival]) -> RecordedDrive:
    return read_drive(write(tmp_path / "recording.mcap", received), silent)


def test_a_pose_is_where_the_robot_was_when_its_readings_were_heard(tmp_path: Path) -> None:
    drive = drive_of(tmp_path, wheels(20) + arrivals(wifi_scan(10.0, age_s=4.0), wifi_scan(8.0), wifi_scan(99.0)))
    assert (drive.stamps_ns / SECOND_NS).tolist() == [6.0, 8.0]
    np.testing.assert_allclose(drive.poses, [[3.0, 0.0, 0.0], [4.0, 0.0, 0.0]], atol=1e-9)
    np.testing.assert_allclose(drive.path_m, [3.0, 4.0], atol=1e-9)
    assert len(drive.odometry) == 200
    assert drive.scans == {}


def test_a_pose_has_the_scan_nearest_in_time_carried_over_by_the_odometry(tmp_path: Path) -> None:
    """Of two poses one scan is the nearer one's, and a scan 3 s away is nobody's."""
    heard = [wifi_scan(second) for second in (4.0, 5.0, 12.0)]
    drive = drive_of(tmp_path, wheels(20) + arrivals(*heard, laser_scan(5.4), laser_scan(15.5)))
    assert list(drive.scans) == [1]
    points = drive.scans[1].points
    np.testing.assert_allclose(points[:, 0], 4.0 + 0.4 * 0.5, atol=1e-5)


def test_absurd_readings_make_no_fingerprint(tmp_path: Path) -> None:
    received = wheels(20) + arrivals(wifi_scan(5.0), wifi_scan(6.0, rssi=3.0), wifi_scan(7.0))
    assert len(drive_of(tmp_path, received).readings) == 2


@pytest.mark.parametrize(
    ("received", "why"),
    [(wheels(20), "no WiFi"), (arrivals(wifi_scan(1.0), wifi_scan(2.0)), "no odometry")],
)
def test_a_recording_without_what_the_method_needs_is_refused(
    tmp_path: Path, received: list[Arrival], why: str
) -> None:
    with pytest.raises(ReproductionError, match=why):
        drive_of(tmp_path, received)
