"""Walls hold the heading where each scan match adds its error, and stay out of it where they stand anyhow."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from graphs import PRIOR, STEP

from wayfi.backend.graph.backend_config import BackendConfig
from wayfi.backend.graph.factors import BetweenFactor, WallFactor
from wayfi.backend.graph.pose_graph import PoseGraph
from wayfi.backend.pose2 import Floats, Pose2, wrap
from wayfi.frontends.axes.wall_headings import WallHeadings
from wayfi.frontends.axes.walls_config import WallsConfig
from wayfi.frontends.keyframes import Keyframe, Keyframes
from wayfi.frontends.odometry.driven_path import PathPoint
from wayfi.frontends.scan_points import ScanPoints

ENABLED = WallsConfig()
STEP_M, DRIFT = 0.5, 0.0005  # m, and rad by which each match of a step errs to the left
Direction = Callable[[int], float]


def axes_at_an_angle(_: int) -> float:
    return 0.3


def scan_of(direction: float, heading: float, rng: np.random.Generator) -> ScanPoints:
    """What is seen of four walls that stand along `direction` and across it, with a fifth of furniture."""
    sides = math.pi / 2 * rng.integers(0, 4, 120)
    walls = direction - heading + sides + rng.normal(0.0, 0.02, 120)
    angles = np.concatenate([walls, rng.uniform(-math.pi, math.pi, 30)])
    bearings = direction - heading + sides + rng.uniform(-math.pi / 4, math.pi / 4, 120)
    ranges = 4.0 / np.cos(bearings - (direction - heading + sides)) + rng.normal(0.0, 0.02, 120)
    points = ranges[:, None] * np.column_stack([np.cos(bearings), np.sin(bearings)])
    points = np.concatenate([points, rng.normal(size=(30, 2))])
    return ScanPoints(points, np.column_stack([np.cos(angles), np.sin(angles)]), Pose2())


class Driving:
    """A drive around square blocks of 10 m in a building whose walls stand along `direction` at each keyframe."""

    def __init__(self, config: WallsConfig, direction: Direction = axes_at_an_angle) -> None:
        self.graph, self.keyframes = PoseGraph(BackendConfig(), PRIOR), Keyframes()
        self.walls = WallHeadings(self.graph, self.keyframes, config)
        self.headings: list[float] = []
        self._direction, self._rng, self._truth = direction, np.random.default_rng(5), Pose2()
        self._unknown_rad2, self._turned_at = 0.0, 0

    def drive(self, steps: int, variance_factor: float = 1.0, turn: Callable[[int], float] | None = None) -> None:
        for k in range(len(self.headings), len(self.headings) + steps):
            by = turn(k) if turn else (math.pi / 2 if k % 20 == 19 else 0.0)
            poses = self.graph.poses()[:k]
            guess = Pose2()
            if k == 0:
                self.graph.add_keyframe(guess)
            else:
                self._truth = self._truth @ Pose2(STEP_M, 0.0, by)
                matched = Pose2(STEP_M, 0.0, by + DRIFT)
                guess = Pose2.of(poses[-1]) @ matched
                self.graph.add_keyframe(guess)
                unseen = np.diag([0.0, 0.0, self._unknown_rad2 if k == self._turned_at else 0.0])
                self.graph.add(BetweenFactor(k - 1, k, matched, STEP / 25 + unseen))
            self.headings.append(self._truth.theta)
            scan = scan_of(self._direction(k), self._truth.theta, self._rng)
            self.keyframes.append(Keyframe(PathPoint(k, Pose2(), k * STEP_M), scan))
            variance = 1e-4 + (k * DRIFT) ** 2 + self._unknown_rad2
            self.walls.follow(np.vstack([poses, guess.array()]), variance, variance_factor)
            self.graph.update()

    def turn_unseen(self, radians: float) -> None:
        """Turn the robot while nothing tells by how much: its heading is known to half a radian from here on."""
        self._truth = self._truth @ Pose2(0.0, 0.0, radians)
        self._unknown_rad2, self._turned_at = 0.25, len(self.headings)

    def errors(self) -> Floats:
        """(n,) rad by which the headings err."""
        return np.array([wrap(e) for e in self.graph.poses()[:, 2] - np.array(self.headings)])

    def factors(self) -> list[WallFactor]:
        return self.graph.of_kind(WallFactor)


def test_walls_hold_the_heading_that_matches_lose() -> None:
    with_walls, without = Driving(ENABLED), Driving(WallsConfig(enabled=False))
    with_walls.drive(200)
    without.drive(200)
    assert without.errors()[-1] > 0.09
    assert without.factors() == []
    assert np.abs(with_walls.errors()).max() < 0.03
    assert {factor.wing for factor in with_walls.factors()} == {1}


def test_the_robot_comes_back_to_a_wing_at_an_angle() -> None:
    driving = Driving(ENABLED, lambda k: 0.7 if 60 <= k < 120 or k >= 180 else 0.3)
    driving.drive(240)
    wings = [factor.wing for factor in driving.factors()]
    assert set(wings) == {1, 2}
    assert wings[-1] == 2
    assert np.abs(driving.errors()).max() < 0.04


def test_a_round_wall_begins_no_wing() -> None:
    """A ring of corridor, 20 m in radius: the nearest walls turn with the robot."""
    driving = Driving(ENABLED, lambda k: 0.025 * k)
    driving.drive(200, turn=lambda _: 0.025)
    assert driving.factors() == []


def test_a_robot_that_was_moved_begins_anew() -> None:
    driving = Driving(ENABLED)
    driving.drive(60)
    driving.keyframes.begin_piece(10.0)
    driving.drive(60)
    assert {factor.wing for factor in driving.factors()} == {1, 2}
    assert all(factor.wing == (1 if factor.b < 60 else 2) for factor in driving.factors())


@pytest.mark.parametrize("radians", [0.3, 1.0, 1.3])
def test_a_robot_that_turned_unseen_takes_no_axis_for_another(radians: float) -> None:
    driving = Driving(ENABLED)
    driving.drive(60)
    driving.turn_unseen(radians)
    driving.drive(60)
    assert all(factor.wing == (1 if factor.b < 60 else 2) for factor in driving.factors())
    assert driving.graph.covariance(119)[2, 2] > 0.9 * 0.25


def test_what_the_graph_claims_too_large_walls_claim_too() -> None:
    driving = Driving(ENABLED)
    driving.drive(100, variance_factor=1.0)
    before = driving.factors()
    driving.walls.weigh_again(0.25)
    driving.graph.update()
    assert [f.sigma_rad for f in driving.factors()] == [2 * f.sigma_rad for f in before]
    driving.drive(20, variance_factor=0.25)
    assert driving.factors()[-1].sigma_rad > 1.8 * before[-1].sigma_rad


def test_a_sample_of_exact_walls_is_believed_more_as_the_drive_goes_on() -> None:
    driving = Driving(WallsConfig(sigma_rad=0.03))
    driving.drive(300)
    sigmas = [factor.sigma_rad for factor in driving.factors()]
    assert sigmas[-1] < 0.7 * sigmas[0]


def test_a_bridge_five_degrees_off_the_house_before_it_does_not_pull_the_heading() -> None:
    driving = Driving(ENABLED, lambda k: 0.3 if k < 80 else 0.39 if k < 140 else 0.8)
    driving.drive(220)
    assert all(factor.wing != 1 for factor in driving.factors() if factor.b >= 80)
    assert len({factor.wing for factor in driving.factors()}) == 3
    assert np.abs(driving.errors()).max() < 0.07


def test_samples_that_may_be_of_the_wing_before_are_used_once_some_in_a_row_are_alike() -> None:
    """Three degrees off it; the heading drifts so far before there are four that each may be of either."""
    driving = Driving(ENABLED, lambda k: 0.3 if k < 60 else 0.36)
    driving.drive(200)
    assert {factor.wing for factor in driving.factors() if factor.b >= 60} == {2}
    assert np.abs(driving.errors()).max() < 0.05


def test_scans_that_saw_two_wings_tell_nothing() -> None:
    driving = Driving(ENABLED, lambda k: 0.3 if k % 2 else 0.35)
    driving.drive(100)
    assert driving.factors() == []
