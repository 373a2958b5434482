"""Rounds on a circle, by wheels that err, with or without a laser: what loops are closed on."""

import math
from dataclasses import dataclass

import numpy as np
from rooms import HALL, see

from wayfi.backend.graph.backend_config import BackendConfig
from wayfi.backend.graph.factors import WheelFactor
from wayfi.backend.graph.pose_graph import PoseGraph
from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.closures.verdicts import Verdicts
from wayfi.frontends.keyframes import Keyframe, Keyframes
from wayfi.frontends.odometry.driven_path import PathPoint
from wayfi.frontends.odometry.odometry_config import OdometryConfig, calibration_prior
from wayfi.frontends.odometry.wheel_noise import wheel_covariance
from wayfi.frontends.wifi.fingerprints import Fingerprint, WifiCandidate
from wayfi.frontends.wifi.readings import Readings

ODOMETRY = OdometryConfig()
PRIOR = calibration_prior(ODOMETRY)
S = 1_000_000_000
STEP_M = 0.5
_NOTHING = Readings((), np.empty(0, np.float32), np.empty(0, np.float32))


@dataclass(frozen=True, slots=True, eq=False)
class Circles:
    """A drive without closures: what is built up, and the truth in the frame of the first pose."""

    graph: PoseGraph
    keyframes: Keyframes
    verdicts: Verdicts
    truth: list[Pose2]
    per_round: int

    @property
    def last(self) -> int:
        """The newest keyframe."""
        return len(self.truth) - 1

    def poses(self) -> Floats:
        """(n, 3) as estimated now."""
        return self.graph.poses()

    def worst_m(self) -> float:
        """How far the estimate is off where it is worst."""
        return max(self.graph.pose(k).distance(T) for k, T in enumerate(self.truth))

    def fingerprint(self, keyframe: int, offset: Pose2 | None = None) -> Fingerprint:
        """One taken at a keyframe, or `offset` from it."""
        point = self.keyframes[keyframe].point
        return Fingerprint(keyframe, point.stamp_ns, "phone", keyframe, offset or Pose2(), point, _NOTHING)

    def candidate(self, a: int, b: int, sigma_m: float = 0.8, mutual: bool = True) -> WifiCandidate:
        """Keyframes a and b sound alike."""
        return WifiCandidate(self.fingerprint(a), self.fingerprint(b), 0.7, sigma_m, mutual)


def drive(rounds: float, radius_m: float = 1.5, bias: float = 0.0, laser: bool = True, seed: int = 0) -> Circles:
    """Half-metre steps by wheels that turn by themselves by `bias` rad/m and do not say so."""
    rng = np.random.default_rng(seed)
    start = Pose2(0.0, -2.5, 0.0)
    graph, keyframes = PoseGraph(BackendConfig(), PRIOR), Keyframes()
    truth, told = [Pose2()], Pose2()
    turn = STEP_M / radius_m
    graph.add_keyframe(Pose2())
    graph.update()
    keyframes.append(Keyframe(PathPoint(0, told, 0.0), see(HALL, start, rng) if laser else None))
    for k in range(1, round(rounds * 2 * math.pi * radius_m / STEP_M) + 1):
        truth.append(truth[-1] @ Pose2(STEP_M * math.cos(turn / 2), STEP_M * math.sin(turn / 2), turn))
        said_turn = turn - STEP_M * bias + rng.normal(0, 0.002)
        told = told @ Pose2(STEP_M * math.cos(said_turn / 2), STEP_M * math.sin(said_turn / 2), said_turn)
        point = PathPoint(k * S, told, STEP_M * k)
        motion = keyframes[k - 1].point.motion_to(point)
        graph.add_keyframe(graph.pose(k - 1) @ motion.corrected(graph.calibration_values()))
        graph.add(WheelFactor(k - 1, k, motion, wheel_covariance(motion, ODOMETRY)))
        graph.update()
        keyframes.append(Keyframe(point, see(HALL, start @ truth[-1], rng) if laser else None))
    return Circles(graph, keyframes, Verdicts(), truth, round(2 * math.pi * radius_m / STEP_M))
