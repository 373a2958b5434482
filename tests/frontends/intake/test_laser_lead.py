"""The laser leads where no odometry comes: by scans or by clouds, and also after the drive was pickled."""

import pickle
from collections.abc import Callable

import numpy as np
import pytest
from clouds import HALL as SPATIAL_HALL
from clouds import cloud_at
from rooms import CORRIDOR, HALL, LOOK_ALIKE

from wayfi.backend.graph.health import State
from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.events import StateChanged
from wayfi.frontends.measurements import SECOND_NS, LaserScan, StaticTransforms, Sweep, Transform
from wayfi.frontends.pipeline import Pipeline
from wayfi.frontends.slam_config import SlamConfig
from wayfi.recordings.simulation import lidar3d
from wayfi.recordings.simulation.laser import ANGLE_INCREMENT, ANGLE_MIN, ranges
from wayfi.recordings.simulation.surfaces import still

STEP = Pose2(0.05, 0.0, 0.01)
START = Pose2(0.0, -2.5, 0.0)
UPRIGHT = Transform("base_link", "lidar", (0.0, 0.0, lidar3d.HEIGHT_M), (0.0, 0.0, 0.0, 1.0))
SWEEPS, PICKLED_AT = 50, 35  # the laser leads after two seconds, 20 sweeps


def planar(number: int, pose: Pose2) -> Sweep:
    seen = ranges(still(HALL), (START @ pose).array()[None], np.zeros(1))[0].astype(np.float32)
    return LaserScan(number * SECOND_NS // 10, "base_link", seen, ANGLE_MIN, ANGLE_INCREMENT, 0.05, 30.0)


def spatial(number: int, pose: Pose2) -> Sweep:
    cloud = cloud_at(SPATIAL_HALL, pose, number)
    return type(cloud)(number * SECOND_NS // 10, "lidar", cloud.points)


@pytest.mark.parametrize("sweep", [planar, spatial])
def test_a_drive_that_the_laser_leads_is_followed_and_goes_on_after_pickling(
    sweep: Callable[[int, Pose2], Sweep],
) -> None:
    drives, pose = [Pipeline(SlamConfig())], Pose2()
    drives[0].process(StaticTransforms(0, (UPRIGHT,)))
    for number in range(SWEEPS):
        if number == PICKLED_AT:
            drives.append(pickle.loads(pickle.dumps(drives[0])))
        pose = pose @ STEP
        for drive in drives:
            drive.process(sweep(number, pose))
    whole, resumed = (drive.finish()[0].final for drive in drives)
    assert len(whole) == len(resumed) == SWEEPS
    np.testing.assert_allclose(resumed, whole, atol=0.005)
    driven_m = Pose2.of(whole[0]).distance(Pose2.of(whole[-1]))
    assert driven_m == pytest.approx(STEP.distance(pose), abs=0.1)


def states_of(faces: Floats) -> set[State]:
    """The states of ten seconds that the laser leads among `faces`, at 0.5 m/s."""
    drive, states = Pipeline(SlamConfig()), set()
    for number in range(100):
        pose = Pose2(-4.0 + 0.05 * number, -0.5, 0.0)
        seen = ranges(still(faces), pose.array()[None], np.zeros(1))[0].astype(np.float32)
        scan = LaserScan(number * SECOND_NS // 10, "base_link", seen, ANGLE_MIN, ANGLE_INCREMENT, 0.05, 30.0)
        states |= {event.state for event in drive.process(scan) if isinstance(event, StateChanged)}
    return states


def test_a_laser_that_leads_along_a_bare_corridor_does_not_claim_to_know_where_it_is() -> None:
    assert states_of(CORRIDOR) == {State.TRACKING, State.UNCERTAIN}
    assert states_of(HALL) == {State.TRACKING}


def after_silence(faces: Floats, start: Pose2, reach_m: float, silent_s: float) -> tuple[list[StateChanged], float]:
    """The states of a drive of 16 s that a laser leads which reaches so far; from 8 s on it is silent for a while.

    Also how far off the pose is at the end. The robot drives on at 0.5 m/s meanwhile.
    """
    drive, states, rng = Pipeline(SlamConfig()), [], np.random.default_rng(0)
    for number in (n for n in range(160) if not 80 <= n < 80 + 10 * silent_s):
        pose = start @ Pose2(0.05 * number, 0.0, 0.0)
        seen = ranges(still(faces), pose.array()[None], np.zeros(1))[0]
        seen += 0.01 * rng.standard_normal(len(seen))
        seen = np.where(seen < reach_m, seen, np.inf).astype(np.float32)
        scan = LaserScan(number * SECOND_NS // 10, "base_link", seen, ANGLE_MIN, ANGLE_INCREMENT, 0.05, reach_m)
        states += [event for event in drive.process(scan) if isinstance(event, StateChanged)]
    last = Pose2.of(drive.finish()[0].final[-1])
    return states, last.distance(Pose2(0.05 * 159, 0.0, 0.0))


@pytest.mark.parametrize("silent_s", [1.0, 2.0, 3.0])
def test_what_was_driven_while_the_leading_laser_was_silent_is_not_known_where_rooms_look_alike(
    silent_s: float,
) -> None:
    states, _ = after_silence(LOOK_ALIKE, Pose2(0.0, 1.0, 0.0), 6.0, silent_s)
    assert [event.state for event in states] == [State.TRACKING, State.UNCERTAIN]
    assert f"for {silent_s + 0.1:.1f} s neither odometry nor scans came" in states[-1].reason


@pytest.mark.parametrize("silent_s", [1.0, 2.0, 3.0])
def test_a_leading_laser_that_was_silent_finds_itself_where_walls_tell_it(silent_s: float) -> None:
    states, off_m = after_silence(HALL, Pose2(-4.5, -2.5, 0.0), 30.0, silent_s)
    assert [event.state for event in states] == [State.TRACKING]
    assert off_m < 0.05
