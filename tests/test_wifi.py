"""Fingerprints and the candidates they propose, on a simulated drive in rounds past access points."""

import math
from dataclasses import dataclass, replace

import numpy as np
import pytest

from wayfi.backend.pose2 import Floats, Pose2, compose_all, wrap
from wayfi.frontends.fingerprints import Readings
from wayfi.frontends.wifi import Fingerprint, Wifi, WifiCandidate, WifiConfig

ACCESS_POINTS = np.random.default_rng(7).uniform(-30, 30, (40, 2))
RADIUS_M = 8.0
ROUND_M = 2 * math.pi * RADIUS_M
S = 1_000_000_000


def heard(xy: Floats, rng: np.random.Generator, sigma_db: float = 2.0) -> Readings:
    """Log-distance path loss with fading; what is weaker than -85 dBm is not heard."""
    distance = np.hypot(*(ACCESS_POINTS - xy).T)
    rssi = -35 - 30 * np.log10(np.maximum(distance, 1.0)) + sigma_db * rng.standard_normal(len(distance))
    kept = np.flatnonzero(rssi > -85)
    names = tuple(f"02:00:00:00:00:{n:02x}" for n in kept)
    return Readings(names, rssi[kept].astype(np.float32), np.zeros(len(kept), np.float32), ())


@dataclass(frozen=True, slots=True, eq=False)
class Heard:
    """A drive in rounds: the poses of its keyframes, and what WiFi proposed."""

    wifi: Wifi
    poses: Floats
    candidates: list[WifiCandidate]


def drive(rounds: float, config: WifiConfig, seed: int = 0, drift: float = 0.0, step_m: float = 0.25) -> Heard:
    """Two scans a keyframe, one keyframe each half metre; the estimate turns away by `drift` rad/m."""
    rng, wifi, candidates = np.random.default_rng(seed), Wifi(config), []
    poses = [np.zeros(3)]
    steps = int(rounds * ROUND_M / step_m)
    truth = Pose2(0.0, 0.0, 0.0)
    for k in range(1, steps + 1):
        truth = truth @ Pose2(step_m, 0.0, step_m / RADIUS_M)
        if k % 2 == 0:
            turn = 2 * step_m * (1 / RADIUS_M + drift)
            poses.append(compose_all(poses[-1], np.array([2 * step_m, 0.0, turn]))[0])
        rest = Pose2() if k % 2 == 0 else Pose2(step_m, 0.0, step_m / RADIUS_M)
        readings = heard(np.array([truth.x, truth.y]), rng)
        fingerprint = wifi.add_scan(k * S, "phone", len(poses) - 1, rest, k * step_m, readings)
        if fingerprint is None:
            continue
        similarity = wifi.similarity(fingerprint)
        if candidate := wifi.candidate(fingerprint, similarity, np.array(poses)):
            candidates.append(candidate)
    return Heard(wifi, np.array(poses), candidates)


def place_m(f: Fingerprint) -> float:
    """Where on its round a fingerprint was heard."""
    return f.path_m % ROUND_M


def test_scans_become_fingerprints_of_half_a_metre() -> None:
    run = drive(1.0, WifiConfig())
    gaps = np.diff([f.path_m for f in run.wifi.fingerprints])
    assert 0.5 <= gaps.min() <= gaps.max() <= 1.0
    assert [f.number for f in run.wifi.fingerprints] == list(range(len(run.wifi.fingerprints)))


def test_a_fingerprint_is_the_mean_of_its_scans_without_what_was_heard_by_chance() -> None:
    wifi = Wifi(WifiConfig(fingerprint_m=10.0, fingerprint_scans=8, min_readings=2))
    done = []
    for k in range(8):
        names = ("a", "b", "chance") if k == 3 else ("a", "b")
        rssi = np.array([-50.0 - k, -70.0, -80.0][: len(names)], np.float32)
        readings = Readings(names, rssi, np.zeros(len(names), np.float32), ())
        done.append(wifi.add_scan(k * S, "phone", k, Pose2(), 0.1 * k, readings))
    assert done[:-1] == [None] * 7
    fingerprint = done[-1]
    assert fingerprint is not None
    assert fingerprint.readings.bssids == ("a", "b")
    np.testing.assert_allclose(fingerprint.readings.rssi, [-53.5, -70.0])
    assert (fingerprint.keyframe, fingerprint.stamp_ns) == (4, 4 * S)


def test_receivers_gather_apart_and_too_few_access_points_name_no_place() -> None:
    wifi = Wifi(WifiConfig(fingerprint_m=1.0, min_readings=2))
    two, one = (Readings(tuple("ab"[:n]), np.full(n, -50, np.float32), np.zeros(n, np.float32), ()) for n in (2, 1))
    assert wifi.add_scan(0, "phone", 0, Pose2(), 0.0, two) is None
    assert wifi.add_scan(0, "tablet", 0, Pose2(), 0.9, one) is None
    first = wifi.add_scan(S, "phone", 0, Pose2(), 1.0, two)
    assert first is not None
    assert first.receiver == "phone"
    assert wifi.add_scan(2 * S, "tablet", 0, Pose2(), 2.0, one) is None
    assert len(wifi.fingerprints) == 1


def test_nothing_is_proposed_before_the_threshold_is_learnt_nor_on_the_first_round() -> None:
    assert Wifi(WifiConfig()).threshold == math.inf
    assert drive(0.95, WifiConfig(min_path_m=30.0)).candidates == []


@pytest.mark.parametrize("seed", range(3))
def test_on_the_second_round_the_same_places_are_proposed(seed: int) -> None:
    run = drive(2.0, WifiConfig(), seed)
    assert len(run.candidates) > 20
    apart = np.array([abs(place_m(c.a) - place_m(c.b)) for c in run.candidates])
    apart = np.minimum(apart, ROUND_M - apart)
    assert np.quantile(apart, 0.9) < 2.0
    config = WifiConfig()
    for c in run.candidates:
        assert c.b.path_m - c.a.path_m >= config.min_path_m
        assert c.similarity >= config.min_similarity
    assert min(np.diff([c.b.path_m for c in run.candidates])) >= config.candidate_every_m


@pytest.mark.parametrize("drift", [0.0, 0.01])
def test_a_sequence_gives_the_pose_of_the_truth_though_the_estimate_has_drifted(drift: float) -> None:
    """Drift bends a window of 20 m by itself; what it adds between the rounds must not be seen."""
    run = drive(2.4, replace(WifiConfig(), window=30), drift=drift)
    fits = [c for c in run.candidates if c.sequence is not None]
    assert len(fits) > 10
    distances, turns, nees = [], [], []
    for c in fits:
        assert c.sequence is not None
        angles = [0.5 * f.keyframe / RADIUS_M for f in (c.a, c.b)]
        a, b = (Pose2(RADIUS_M * math.sin(t), RADIUS_M * (1 - math.cos(t)), t) for t in angles)
        T, found = a.between(b), c.sequence.T_a_b
        distances.append(found.distance(T))
        turns.append(abs(wrap(found.theta - T.theta)))
        e = np.array([found.x - T.x, found.y - T.y, wrap(found.theta - T.theta)])
        nees.append(float(e @ np.linalg.solve(c.sequence.covariance, e)) / 3)
        assert c.sequence.residual_m < WifiConfig().max_residual_m
    assert np.median(distances) < 1.0
    assert np.median(turns) < 0.2
    assert np.median(nees) < 3.0


def test_places_follow_their_keyframes() -> None:
    run = drive(0.5, WifiConfig())
    moved = compose_all(np.array([5.0, -3.0, 1.0]), run.poses)
    np.testing.assert_allclose(
        run.wifi.places(moved)[:, :2], Pose2(5.0, -3.0, 1.0).transform(run.wifi.places(run.poses)[:, :2]), atol=1e-9
    )
    assert Wifi(WifiConfig()).places(np.zeros((1, 3))).shape == (0, 3)
