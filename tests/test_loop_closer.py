"""Loops closed by the estimate, by the laser and by WiFi alone; closures that prove wrong are taken back."""

import math
import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from wayfi.backend.pose2 import Floats, Pose2
from wayfi.backend.pose_graph import BackendConfig, Between, PoseGraph, Wheels
from wayfi.backend.wheel_calibration import WheelMotion
from wayfi.frontends.closure import ClosureConfig
from wayfi.frontends.events import CheckDone, ClosureJudged, ClosureKind, Event, SequenceMatched, Verdict, Warned
from wayfi.frontends.fingerprints import Readings
from wayfi.frontends.keyframes import Keyframe, Keyframes
from wayfi.frontends.lidar import LidarConfig
from wayfi.frontends.loop_closer import LoopCloser
from wayfi.frontends.odometry import OdometryConfig, PathPoint, calibration_prior, wheel_covariance
from wayfi.frontends.sequence import SequenceFit
from wayfi.frontends.wifi import Fingerprint, WifiCandidate, WifiConfig

sys.path.insert(0, str(Path(__file__).parent))
from rooms import HALL, see

ODOMETRY = OdometryConfig()
PRIOR = calibration_prior(ODOMETRY)
S = 1_000_000_000
READINGS = Readings((), np.empty(0, np.float32), np.empty(0, np.float32), ())


@dataclass(frozen=True, slots=True, eq=False)
class Drive:
    """Rounds on a circle: what is built up, and the truth (n,) in the frame of the first pose."""

    graph: PoseGraph
    keyframes: Keyframes
    closer: LoopCloser
    truth: list[Pose2]

    def poses(self) -> Floats:
        return self.graph.poses()


def drive(rounds: float, radius_m: float = 1.5, bias: float = 0.0, laser: bool = True, seed: int = 0) -> Drive:
    """Half-metre steps by wheels that turn by themselves by `bias` rad/m and do not say so, without closures."""
    rng = np.random.default_rng(seed)
    start = Pose2(0.0, -2.5, 0.0)
    graph, keyframes = PoseGraph(BackendConfig(), PRIOR), Keyframes()
    closer = LoopCloser(graph, keyframes, PRIOR, ClosureConfig(), LidarConfig(), WifiConfig())
    truth, told = [Pose2()], Pose2()
    turn = 0.5 / radius_m
    graph.add_keyframe(Pose2())
    graph.update()
    keyframes.append(Keyframe(PathPoint(0, told, 0.0), see(HALL, start, rng) if laser else None))
    for k in range(1, round(rounds * 2 * math.pi * radius_m / 0.5) + 1):
        truth.append(truth[-1] @ Pose2(0.5 * math.cos(turn / 2), 0.5 * math.sin(turn / 2), turn))
        said_turn = turn - 0.5 * bias + rng.normal(0, 0.002)
        told = told @ Pose2(0.5 * math.cos(said_turn / 2), 0.5 * math.sin(said_turn / 2), said_turn)
        point = PathPoint(k * S, told, 0.5 * k)
        motion = keyframes[k - 1].point.motion_to(point)
        graph.add_keyframe(graph.pose(k - 1) @ motion.corrected(graph.calibration_values()))
        graph.add(Wheels(k - 1, k, motion, wheel_covariance(motion, ODOMETRY)))
        graph.update()
        keyframes.append(Keyframe(point, see(HALL, start @ truth[-1], rng) if laser else None))
    return Drive(graph, keyframes, closer, truth)


def fingerprint(run: Drive, keyframe: int, offset: Pose2 | None = None) -> Fingerprint:
    point = run.keyframes[keyframe].point
    return Fingerprint(keyframe, point.stamp_ns, "phone", keyframe, offset or Pose2(), point.path_m, READINGS)


def candidate(run: Drive, a: int, b: int, sequence: SequenceFit | None = None) -> WifiCandidate:
    return WifiCandidate(fingerprint(run, a), fingerprint(run, b), 0.7, sequence)


def judged(events: list[Event]) -> list[ClosureJudged]:
    return [event for event in events if isinstance(event, ClosureJudged)]


def test_the_estimate_proposes_the_laser_checks_and_the_graph_believes() -> None:
    run = drive(2.2, bias=0.01)
    b, poses = len(run.truth) - 1, run.poses()
    events = run.closer.close_by_estimate(b, 7, poses)
    check, verdict = events
    assert isinstance(check, CheckDone)
    assert isinstance(verdict, ClosureJudged)
    assert (verdict.verdict, verdict.kind, verdict.proposed_by) == (Verdict.ACCEPTED, ClosureKind.LIDAR, "estimate")
    assert (check.keyframe_b, verdict.keyframe_b, verdict.stamp_b_ns) == (b, b, b * S)
    T_a_b = run.truth[verdict.keyframe_a].between(run.truth[b])
    assert verdict.T_a_b.distance(T_a_b) < 0.1
    before = run.graph.pose(b).distance(run.truth[b])
    assert run.graph.pending
    run.graph.update()
    assert run.graph.pose(b).distance(run.truth[b]) < max(0.5 * before, 0.15)


def test_checks_keep_their_distance_and_need_a_scan() -> None:
    run = drive(2.2)
    b, poses = len(run.truth) - 1, run.poses()
    assert len(run.closer.close_by_estimate(b - 1, 0, poses)) == 2
    assert run.closer.close_by_estimate(b, 0, poses) == []
    assert drive(2.2, laser=False).closer.close_by_estimate(b, 0, poses) == []
    assert drive(0.9).closer.close_by_estimate(15, 0, poses) == []


def test_wifi_proposes_and_the_laser_gives_the_pose() -> None:
    run = drive(2.2, bias=0.005)
    b = len(run.truth) - 1
    events = run.closer.close_by_wifi(candidate(run, 3, b), 0, run.poses())
    (verdict,) = judged(events)
    assert (verdict.kind, verdict.proposed_by, verdict.similarity) == (ClosureKind.LIDAR, "wifi", 0.7)
    assert isinstance(events[0], CheckDone)


def test_a_keyframe_is_not_closed_with_itself() -> None:
    run = drive(0.5, laser=False)
    assert run.closer.close_by_wifi(candidate(run, 5, 5), 0, run.poses()) == []


def test_without_a_laser_one_fingerprint_claims_its_place_but_no_heading() -> None:
    run = drive(2.0, radius_m=4.0, laser=False)
    a, b = 5, 55
    events = run.closer.close_by_wifi(
        WifiCandidate(fingerprint(run, a, Pose2(0.2, 0.1, 0.0)), fingerprint(run, b, Pose2(-0.1, 0.3, 0.0)), 0.7, None),
        0,
        run.poses(),
    )
    (verdict,) = judged(events)
    assert (verdict.verdict, verdict.kind, verdict.proposed_by) == (Verdict.ACCEPTED, ClosureKind.WIFI, "fingerprint")
    assert not verdict.heading_claimed
    assert math.sqrt(verdict.covariance[0, 0]) == WifiConfig().sigma_m
    here = Pose2(0.2, 0.1, 0.0).array()[:2]
    there = verdict.T_a_b.transform(np.array([[-0.1, 0.3]]))[0]
    np.testing.assert_allclose(here, there, atol=1e-9)


def test_a_sequence_claims_its_pose_and_is_shown() -> None:
    run = drive(2.0, radius_m=4.0, laser=False)
    T = run.truth[5].between(run.truth[55])
    places = np.array([[0.0, 0.0], [1.0, 0.0]])
    fit = SequenceFit(T, np.diag([0.5, 0.5, 0.01]), 0.4, T.transform(places), places)
    shown, verdict, *_ = run.closer.close_by_wifi(candidate(run, 5, 55, fit), 9, run.poses())
    assert isinstance(shown, SequenceMatched)
    assert (shown.keyframe_a, shown.keyframe_b, shown.stamp_ns) == (5, 55, 9)
    np.testing.assert_allclose(shown.points_a, run.graph.pose(5).transform(T.transform(places)), atol=1e-9)
    assert isinstance(verdict, ClosureJudged)
    assert (verdict.verdict, verdict.proposed_by, verdict.heading_claimed) == (Verdict.ACCEPTED, "sequence", True)
    assert verdict.T_a_b == T


def test_what_contradicts_the_estimate_is_refused_and_leaves_the_graph_alone() -> None:
    run = drive(2.0, radius_m=4.0, laser=False)
    before, factors = run.poses(), run.graph.factors()
    (verdict,) = judged(run.closer.close_by_wifi(candidate(run, 5, 30), 0, before))
    assert verdict.verdict is Verdict.REFUSED
    assert "contradicts the estimate" in verdict.reason
    run.graph.update()
    assert run.graph.factors() == factors
    np.testing.assert_array_equal(run.poses(), before)


def test_a_closure_that_the_others_contradict_is_taken_back() -> None:
    run = drive(2.0, radius_m=4.0, laser=False, seed=3)
    T = run.truth[5].between(run.truth[55])
    wrong = SequenceFit(
        Pose2(T.x + 2.5, T.y - 2.0, T.theta), np.diag([0.1, 0.1, 0.01]), 0.4, np.zeros((2, 2)), np.zeros((2, 2))
    )
    wide = replace(ClosureConfig(), gate_chi2=1e6)
    run = Drive(
        run.graph,
        run.keyframes,
        LoopCloser(run.graph, run.keyframes, PRIOR, wide, LidarConfig(), WifiConfig()),
        run.truth,
    )
    (accepted,) = judged(run.closer.close_by_wifi(candidate(run, 5, 55, wrong), 0, run.poses()))
    assert accepted.verdict is Verdict.ACCEPTED
    for a in range(0, 20, 2):
        run.graph.add(Between(a, a + 50, run.truth[a].between(run.truth[a + 50]), np.diag([0.01, 0.01, 0.001])))
    run.graph.update()
    (removed,) = judged(run.closer.review(run.poses()))
    assert (removed.closure, removed.verdict) == (accepted.closure, Verdict.REMOVED)
    assert run.graph.pending
    run.graph.update()
    assert run.closer.review(run.poses()) == []
    assert max(run.graph.pose(k).distance(T) for k, T in enumerate(run.truth)) < 0.3


def test_another_turn_bias_that_explains_the_closures_is_taken_up() -> None:
    """Wheels that turn by 0.075 rad/m, nearly 4 sigmas beyond what is believed: the first closures are refused."""
    run = drive(4.0, radius_m=4.0, bias=0.075, laser=False)
    events: list[Event] = []
    per_round = round(2 * math.pi * 4.0 / 0.5)
    for b in range(per_round, len(run.truth), 10):
        events += run.closer.close_by_wifi(candidate(run, b - per_round, b), 0, run.poses())
        run.graph.update()
        events += run.closer.review(run.poses())
        run.graph.update()
    run.graph.settle()
    assert any(isinstance(event, Warned) and "turn bias" in event.text for event in events)
    assert abs(run.graph.calibration().values[2] - 0.075) < 0.015
    assert max(run.graph.pose(k).distance(T) for k, T in enumerate(run.truth)) < 1.5
    last = {event.closure: event.verdict for event in judged(events)}
    assert list(last.values()).count(Verdict.ACCEPTED) > 0.8 * len(last)


def test_motions_of_the_helper_are_those_of_a_circle() -> None:
    run = drive(1.0, radius_m=4.0, laser=False)
    assert run.truth[-1].distance(Pose2()) < 0.3
    assert isinstance(run.graph.wheels()[0].motion, WheelMotion)
