"""Odometry that is silent for five seconds: it counted on meanwhile, stood still, or began anew."""

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from drives import Arrival, Simulated, run, simulated, write

from wayfi.backend.pose2 import Pose2, between_all
from wayfi.frontends.measurements import SECOND_NS, Odometry
from wayfi.recordings.files.tum import read_tum
from wayfi.recordings.simulation.run import EPOCH_NS
from wayfi.recordings.simulation.worlds.blueprints import World

SILENT_S = 15.0, 20.0
AROUND_S = 14.0, 25.0
DRIVEN_M = 11.0

Poses = Callable[[Pose2, Pose2, Pose2], Pose2]


def silent(drive: Simulated, poses: Poses) -> list[Arrival]:
    """The drive without odometry for a while; `poses` gives what is said after it.

    Of the last pose before the silence, the first one after it, and the one that would be said.
    """
    begins, ends = SILENT_S
    wheels = [a for a in drive.arrivals if isinstance(a.measurement, Odometry)]
    before: Any = max((a for a in wheels if a.second < begins), key=lambda a: a.second).measurement
    after: Any = min((a for a in wheels if a.second >= ends), key=lambda a: a.second).measurement

    def said(arrival: Arrival) -> Arrival:
        m = arrival.measurement
        if not isinstance(m, Odometry) or arrival.second < ends:
            return arrival
        return replace(arrival, measurement=replace(m, pose=poses(before.pose, after.pose, m.pose)))

    return [said(a) for a in drive.arrivals if not (isinstance(a.measurement, Odometry) and begins <= a.second < ends)]


def counted_on(_before: Pose2, _after: Pose2, pose: Pose2) -> Pose2:
    return pose


def stood_still(before: Pose2, after: Pose2, pose: Pose2) -> Pose2:
    return before @ after.between(pose)


def began_anew(_before: Pose2, after: Pose2, pose: Pose2) -> Pose2:
    return after.between(pose)


def error_across_m(drive: Simulated, poses: Poses, folder: Path) -> float:
    """How far the motion from before the silence to after it is off, as it was published."""
    recording = write(folder / "recording.mcap", silent(drive, poses))
    run(recording, folder / "out")
    stamps_ns = np.array([EPOCH_NS + round(second * SECOND_NS) for second in AROUND_S])
    estimated, true = (t.at(stamps_ns) for t in (read_tum(folder / "out" / "online.tum"), drive.truth))
    difference = between_all(estimated[0], estimated[1:]) - between_all(true[0], true[1:])
    return math.hypot(*difference[0, :2])


@pytest.mark.parametrize("seed", [6, 7])
def test_in_a_corridor_the_wheels_tell_the_way_of_a_silence(seed: int, tmp_path: Path) -> None:
    """The laser, which leads meanwhile, stands still or goes back there; a wheel knows its scale to 4 %."""
    assert error_across_m(simulated(World.CORRIDOR, 0.5, seed), counted_on, tmp_path) < 0.05 * DRIVEN_M


@pytest.mark.parametrize("poses", [counted_on, stood_still, began_anew])
def test_in_a_hall_no_wheels_spoil_what_the_laser_knows(poses: Poses, half_minute: Simulated, tmp_path: Path) -> None:
    assert error_across_m(half_minute, poses, tmp_path) < 0.15
