"""Fingerprints and the candidates they propose, on a simulated drive in rounds past access points."""

import math
from dataclasses import dataclass

import numpy as np
import pytest

from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.odometry.driven_path import PathPoint
from wayfi.frontends.wifi.fingerprint_index import Similar
from wayfi.frontends.wifi.fingerprints import Fingerprint, WifiCandidate
from wayfi.frontends.wifi.readings import PlacedWifiScan, Readings
from wayfi.frontends.wifi.wifi_config import WifiConfig
from wayfi.frontends.wifi.wifi_frontend import WifiFrontend

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
    return Readings(names, rssi[kept].astype(np.float32), np.zeros(len(kept), np.float32))


@dataclass(frozen=True, slots=True, eq=False)
class Heard:
    """A drive in rounds: the poses of its keyframes, what WiFi proposed, and with which verdict it was released."""

    wifi: WifiFrontend
    poses: Floats
    candidates: list[WifiCandidate]
    released: list[WifiCandidate]


def add(
    wifi: WifiFrontend, receiver: str, point: PathPoint, readings: Readings, keyframe: int = 0, T: Pose2 | None = None
) -> Fingerprint | None:
    """A scan of fresh readings at `point`."""
    taken_m = np.full(len(readings.bssids), point.path_m)
    return wifi.add_scan(PlacedWifiScan(receiver, point, readings, taken_m), keyframe, T or Pose2())


def drive(rounds: float, config: WifiConfig, seed: int = 0, step_m: float = 0.25) -> Heard:
    """Two scans a keyframe, one keyframe each half metre."""
    rng, wifi, candidates, released = np.random.default_rng(seed), WifiFrontend(config, {}), [], []
    poses = [np.zeros(3)]
    truth = Pose2()
    for k in range(1, int(rounds * ROUND_M / step_m) + 1):
        truth = truth @ Pose2(step_m, 0.0, step_m / RADIUS_M)
        if k % 2 == 0:
            poses.append(truth.array())
        rest = Pose2() if k % 2 == 0 else Pose2(step_m, 0.0, step_m / RADIUS_M)
        point = PathPoint(k * S, truth, k * step_m)
        readings = heard(np.array([truth.x, truth.y]), rng)
        fingerprint = add(wifi, "phone", point, readings, len(poses) - 1, rest)
        if fingerprint is None:
            continue
        if candidate := wifi.candidate(fingerprint, wifi.similar(fingerprint)):
            candidates.append(candidate)
            wifi.hold(candidate)
        released += wifi.released()
    return Heard(wifi, np.array(poses), candidates, released + wifi.released(at_end=True))


def at(path_m: float, stamp_ns: int = 0) -> PathPoint:
    """Somewhere on a straight path."""
    return PathPoint(stamp_ns, Pose2(path_m, 0.0, 0.0), path_m)


def apart_m(candidate: WifiCandidate) -> float:
    """Between the two places on the circle, along it."""
    apart = abs(place_m(candidate.a) - place_m(candidate.b))
    return min(apart, ROUND_M - apart)


def place_m(f: Fingerprint) -> float:
    """Where on its round a fingerprint was heard."""
    return f.path_m % ROUND_M


def test_scans_become_fingerprints_of_half_a_metre() -> None:
    run = drive(1.0, WifiConfig())
    gaps = np.diff([f.path_m for f in run.wifi.fingerprints])
    assert 0.5 <= gaps.min() <= gaps.max() <= 1.0
    assert [f.number for f in run.wifi.fingerprints] == list(range(len(run.wifi.fingerprints)))


def test_a_fingerprint_is_the_mean_of_its_scans_without_what_was_heard_by_chance() -> None:
    wifi = WifiFrontend(WifiConfig(fingerprint_m=10.0, fingerprint_scans=8, min_readings=2), {})
    done = []
    for k in range(8):
        names = ("a", "b", "chance") if k == 3 else ("a", "b")
        rssi = np.array([-50.0 - k, -70.0, -80.0][: len(names)], np.float32)
        readings = Readings(names, rssi, np.zeros(len(names), np.float32))
        done.append(add(wifi, "phone", at(0.1 * k, k * S), readings, k))
    assert done[:-1] == [None] * 7
    fingerprint = done[-1]
    assert fingerprint is not None
    assert fingerprint.readings.bssids == ("a", "b")
    np.testing.assert_allclose(fingerprint.readings.rssi, [-53.5, -70.0])
    assert (fingerprint.keyframe, fingerprint.stamp_ns) == (4, 4 * S)


def test_a_robot_that_stands_gets_one_fingerprint_of_each_receiver() -> None:
    wifi, rng = WifiFrontend(WifiConfig(), {}), np.random.default_rng(0)
    for _ in range(200):
        for receiver in ("phone", "tablet"):
            add(wifi, receiver, at(3.0), heard(np.zeros(2), rng))
    assert [f.receiver for f in wifi.fingerprints] == ["phone", "tablet"]
    add(wifi, "phone", at(3.1), heard(np.zeros(2), rng))
    assert add(wifi, "phone", at(3.7), heard(np.zeros(2), rng)) is not None


def test_scans_far_apart_are_not_one_place() -> None:
    """A phone that scans each half minute; and one that falls silent for a while."""
    wifi, rng = WifiFrontend(WifiConfig(), {}), np.random.default_rng(0)
    scans = {0.0: "phone", 5.0: "phone", 10.0: "phone", 60.0: "phone", 60.6: "phone"}
    done = [add(wifi, name, at(m), heard(np.array([m, 0.0]), rng)) for m, name in scans.items()]
    assert [f and f.path_m for f in done] == [None, 0.0, 5.0, None, 60.6], "what lay in waiting for 50 m is too late"


def test_a_fingerprint_that_comes_late_is_no_neighbours_earlier_place() -> None:
    wifi, rng = WifiFrontend(WifiConfig(), {}), np.random.default_rng(0)
    for k in range(400):
        add(wifi, "phone", at(0.25 * k), heard(np.array([0.25 * k, 0.0]), rng), k)
        for f in wifi.fingerprints[-1:]:
            wifi.similar(f)
    late = wifi.fingerprints[-30]
    similar = Similar(np.array([late.number - 5]), np.array([0.99]))
    assert wifi.candidate(late, similar) is None


def test_receivers_gather_apart_and_too_few_access_points_name_no_place() -> None:
    wifi = WifiFrontend(WifiConfig(fingerprint_m=1.0, min_readings=2), {})
    two, one = (Readings(tuple("ab"[:n]), np.full(n, -50, np.float32), np.zeros(n, np.float32)) for n in (2, 1))
    assert add(wifi, "phone", at(0.0), two) is None
    assert add(wifi, "tablet", at(0.9), one) is None
    first = add(wifi, "phone", at(1.0), two)
    assert first is not None
    assert first.receiver == "phone"
    assert add(wifi, "tablet", at(2.0), one) is None
    assert len(wifi.fingerprints) == 1


def test_nothing_is_proposed_before_similarity_has_a_meaning_nor_on_the_first_round() -> None:
    """A place heard before, at once: what similarity means is not known yet."""
    wifi = WifiFrontend(WifiConfig(min_path_m=1.0), {})
    rng = np.random.default_rng(0)
    for k in range(20):
        fingerprint = add(wifi, "phone", at(0.5 * k), heard(np.zeros(2), rng))
        if fingerprint is not None:
            assert wifi.candidate(fingerprint, wifi.similar(fingerprint)) is None
    assert drive(0.9, WifiConfig()).candidates == []


@pytest.mark.parametrize("seed", range(3))
def test_on_the_second_round_the_same_places_are_proposed(seed: int) -> None:
    run, config = drive(2.0, WifiConfig(), seed), WifiConfig()
    assert len(run.candidates) > 20
    assert np.quantile([apart_m(c) for c in run.candidates], 0.9) < 2.0
    assert all(c.b.path_m - c.a.path_m >= config.min_path_m for c in run.candidates)
    assert min(np.diff([c.b.path_m for c in run.candidates])) >= config.candidate_every_m


@pytest.mark.parametrize("seed", range(3))
def test_a_candidates_sigma_is_honest(seed: int) -> None:
    mutual = [c for c in drive(3.0, WifiConfig(), seed).released if c.mutual]
    assert len(mutual) > 10
    normalised = np.mean([(apart_m(c) / c.sigma_m) ** 2 / 2 for c in mutual])
    assert 0.1 < normalised < 2.0, "the circle has errors along it only: half of the two dimensions claimed"


def test_a_candidate_waits_for_the_path_beside_it_and_only_each_others_best_are_mutual() -> None:
    run = drive(2.0, WifiConfig())
    assert [c.b.number for c in run.released] == [c.b.number for c in run.candidates]
    mutual = [c for c in run.released if c.mutual]
    assert 0 < len(mutual) < len(run.released)
    assert np.mean([apart_m(c) for c in mutual]) < np.mean([apart_m(c) for c in run.released])


def test_nothing_is_released_before_the_path_beside_it_is_driven() -> None:
    run = drive(2.0, WifiConfig())
    last = run.wifi.fingerprints[-1]
    early = WifiCandidate(run.wifi.fingerprints[0], last, 0.9, 1.0)
    run.wifi.hold(early)
    assert run.wifi.released() == []
    (released,) = run.wifi.released(at_end=True)
    assert released.b is last


def test_a_slow_scanner_on_a_quick_robot_proposes_loops_too() -> None:
    """A scan each three seconds at a metre a second: no two fingerprints of a pass are within near_m of each other."""
    scarce = drive(12.0, WifiConfig(), step_m=3.2)
    gaps = np.diff([f.path_m for f in scarce.wifi.fingerprints])
    assert gaps.min() > WifiConfig().near_m
    assert len(scarce.candidates) > 5
    a, b = (
        [(Pose2.of(scarce.poses[f.keyframe]) @ f.T_keyframe_base).array()[:2] for f in side]
        for side in zip(*((c.a, c.b) for c in scarce.candidates), strict=True)
    )
    assert np.median(np.hypot(*(np.array(a) - np.array(b)).T)) < 4.0
