"""The law of the wheels: where no laser sees, their heading errs over 160 keyframes as much as is claimed."""

from functools import cache

import numpy as np
import pytest
from true_matches import keyframe_seconds
from wheel_headings import Steps, foretold, learnt, steps_of

from wayfi.backend.pose2 import Floats
from wayfi.recordings.simulation.robots.models import Robot
from wayfi.recordings.simulation.run import start
from wayfi.recordings.simulation.worlds.blueprints import World

AHEAD = 160  # keyframes, 80 m
SEEDS = range(4)


@cache
def steps(robot: Robot) -> tuple[Steps, ...]:
    """The steps of a robot's drives, over all worlds and seeds."""
    runs = [start(world, seed, robot=robot) for world in World for seed in SEEDS]
    keyframes = [keyframe_seconds(run.truth.poses, run.truth.seconds(run.truth.stamps_ns)) for run in runs]
    return tuple(steps_of(run, at) for run, at in zip(runs, keyframes, strict=True))


def ratios(robot: Robot) -> Floats:
    """(k,) squared heading errors over claimed variances."""
    return np.concatenate([foretold(drive, AHEAD) for drive in steps(robot)])


@pytest.mark.parametrize("robot", [Robot.TYPICAL, Robot.CHEAP], ids=str)
def test_the_walk_that_is_learnt_claims_what_wheels_err_where_no_scan_matches(robot: Robot) -> None:
    assert 0.5 < ratios(robot).mean() < 2.0


def test_wheels_whose_errors_are_constant_err_no_more_than_claimed() -> None:
    assert ratios(Robot.IDEAL).mean() < 2.0


def test_wheels_whose_errors_are_constant_teach_a_slower_walk_than_others() -> None:
    constant, changing = (np.median([learnt(drive) for drive in steps(r)]) for r in (Robot.IDEAL, Robot.CHEAP))
    assert constant < 0.3 < changing
