"""The laser's clock against the odometry's, told by the turns that both see."""

import math

import numpy as np
import pytest

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.lidar.laser_clock import LaserClock
from wayfi.frontends.lidar.lidar_config import LaserClockConfig
from wayfi.frontends.odometry.driven_path import DrivenPath, LedStep
from wayfi.frontends.odometry.odometry_config import OdometryConfig

S = 1_000_000_000
SECONDS, EVERY_S = 240, 2


def heading(t_s: float) -> float:
    """Of a robot that turns a quarter at irregular times."""
    return sum(math.pi / 4 * (1 + math.tanh(t_s - turn_s)) for turn_s in (10, 22, 45, 51, 80, 97, 130, 144, 171, 200))


def found(
    laser_late_s: float, turn_scale: float = 1.0, noise_rad: float = 0.01, turns: bool = True, led_s: float = 0.0
) -> list[float]:
    """What the clock finds when the laser's stamps say `laser_late_s` more than the odometry's.

    At first the laser leads for `led_s`: the path turns at its stamps.
    """
    rng = np.random.default_rng(0)
    path, clock, told = DrivenPath(OdometryConfig()), LaserClock(LaserClockConfig()), []
    for tick in range(10 * SECONDS):
        t_s = tick / 10
        by_laser = t_s < led_s
        theta = heading(t_s - laser_late_s) if by_laser else turn_scale * heading(t_s)
        path.advance(tick * S // 10, Pose2(0.05 * tick, 0.0, theta * turns), LedStep() if by_laser else None)
        if tick % (10 * EVERY_S) == 0 and tick:
            turned = (heading(t_s - laser_late_s) - heading(t_s - EVERY_S - laser_late_s)) * turns
            clock.add_turn((tick - 10 * EVERY_S) * S // 10, tick * S // 10, turned + rng.normal(0.0, noise_rad))
        offset_s = clock.offset_s(path)
        if offset_s is not None:
            told.append(offset_s)
    return told


@pytest.mark.parametrize("late_s", [-2.5, -1.0, -0.4, 0.4, 1.0, 2.5])
def test_an_offset_of_the_clock_is_found(late_s: float) -> None:
    assert found(late_s)[-1] == pytest.approx(-late_s, abs=0.05)


@pytest.mark.parametrize("turn_scale", [0.85, 1.0, 1.15])
@pytest.mark.parametrize("noise_rad", [0.0, 0.05, 0.15])
def test_a_clock_that_is_right_is_let_be(turn_scale: float, noise_rad: float) -> None:
    assert found(0.0, turn_scale, noise_rad) == []


def test_a_robot_that_does_not_turn_tells_nothing() -> None:
    assert found(2.0, turns=False) == []


def test_an_offset_beyond_reach_is_not_made_up() -> None:
    assert found(60.0) == []


def test_turns_while_the_laser_leads_say_nothing_of_its_clock() -> None:
    assert found(0.3, led_s=110.0)[-1] == pytest.approx(-0.3, abs=0.05)


def test_turns_from_before_the_odometry_are_passed_over() -> None:
    clock, path = LaserClock(LaserClockConfig()), DrivenPath(OdometryConfig())
    clock.add_turn(0, S, 1.0)
    for tick in range(100, 200):
        path.advance(tick * S // 10, Pose2(0.01 * tick, 0.0, 0.0))
    assert clock.offset_s(path) is None
