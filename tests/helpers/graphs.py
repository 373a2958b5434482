"""Pose graphs of chains, and of drives in rounds by wheels that err."""

import math
from dataclasses import dataclass

import numpy as np

from wayfi.backend.graph.backend_config import BackendConfig
from wayfi.backend.graph.factors import BetweenFactor, WheelFactor
from wayfi.backend.graph.pose_graph import PoseGraph
from wayfi.backend.graph.wheel_calibration import WheelMotion
from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.odometry.odometry_config import OdometryConfig, calibration_prior

PRIOR = calibration_prior(OdometryConfig())
STEP = np.diag([0.02**2, 0.01**2, 0.01**2])
CLOSURE = np.diag([0.05**2, 0.05**2, 0.02**2])
WHEELS = np.diag([0.002**2, 0.002**2, 0.0035**2])
ARC = [Pose2(0.5, 0.02 * k, 0.15) for k in range(10)]


def chain(steps: list[Pose2], covariance: Floats = STEP) -> PoseGraph:
    """A graph of relative poses, one behind the other."""
    graph = PoseGraph(BackendConfig(), PRIOR)
    T = Pose2()
    graph.add_keyframe(T)
    for k, step in enumerate(steps):
        T = T @ step
        graph.add_keyframe(T)
        graph.add(BetweenFactor(k, k + 1, step, covariance))
    graph.update()
    return graph


@dataclass(frozen=True, slots=True, eq=False)
class Loops:
    """A drive in rounds: the truth (n + 1, 3) and what wheels of `calibration` said of each step."""

    truth: list[Pose2]
    motions: list[WheelMotion]


def loops(calibration: Floats, rounds: int, per_round: int = 80, seed: int = 0, noise: float = 1.0) -> Loops:
    """Rounds of a figure of eight, an oval to the left and one to the right, in steps of half a metre.

    Wheels err by `calibration`, and at random by 1 mm and 0.2 degrees a step.
    """
    rng = np.random.default_rng(seed)
    truth, motions = [Pose2()], []
    for k in range(rounds * per_round):
        quarter = 8 * (k % per_round) // per_round
        turn = 8 * math.pi / per_round * (1 if quarter < 4 else -1) * (quarter % 2)
        true = Pose2(0.5 * math.cos(turn / 2), 0.5 * math.sin(turn / 2), turn)
        truth.append(truth[-1] @ true)
        scale, turn_scale, per_m, _ = calibration
        told = (turn - per_m * 0.5) / (1 + turn_scale)
        length, extra = 0.5 / (1 + scale), turn - told
        x, y, theta = noise * rng.normal(0, [0.001, 0.001, 0.0035])
        said = Pose2(
            length * math.cos(turn / 2 - extra / 2) + x, length * math.sin(turn / 2 - extra / 2) + y, told + theta
        )
        motions.append(WheelMotion(said, 0.5, 1.0))
    return Loops(truth, motions)


def drive(graph: PoseGraph, drive: Loops, closures: dict[int, int], covariance: Floats = CLOSURE) -> None:
    """Feed a drive as the pipeline does; `closures` maps a keyframe to the earlier one that it is related to."""
    graph.add_keyframe(Pose2())
    graph.update()
    for k, motion in enumerate(drive.motions):
        graph.add_keyframe(graph.pose(k) @ motion.corrected(graph.calibration_values()))
        graph.add(WheelFactor(k, k + 1, motion, WHEELS))
        if (a := closures.get(k + 1)) is not None:
            graph.add(BetweenFactor(a, k + 1, drive.truth[a].between(drive.truth[k + 1]), covariance))
        graph.update()


def errors_m(graph: PoseGraph, truth: list[Pose2]) -> Floats:
    return np.array([graph.pose(k).distance(T) for k, T in enumerate(truth)])
