"""The pose at once: extrapolated from the newest estimate, whenever that came."""

from copy import deepcopy

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from odometry_streams import FAULT_LISTS, stream

from wayfi.backend.graph.health import State
from wayfi.backend.pose2 import Pose2
from wayfi.frontends.events import PosePublished
from wayfi.frontends.measurements import Odometry
from wayfi.frontends.odometry.driven_path import PathPoint
from wayfi.frontends.odometry.live_pose import (
    ESTIMATE_EVERY,
    ORIGIN_COVARIANCE,
    Anchor,
    Estimate,
    EstimateSchedule,
    LivePose,
)
from wayfi.frontends.odometry.odometry_config import OdometryConfig
from wayfi.frontends.pipeline import Pipeline
from wayfi.frontends.slam_config import SlamConfig

CONFIG = OdometryConfig()
Values = tuple[object, ...]


def values(pose: PosePublished | None) -> Values | None:
    """A pose as values that compare bit for bit."""
    if pose is None:
        return None
    return pose.stamp_ns, pose.T_map_base, pose.T_map_odom, pose.T_odom_base, pose.covariance.tobytes(), pose.state


def estimated(messages: list[Odometry]) -> list[tuple[Estimate | None, Values | None]]:
    """For each message the estimate that is due after it, if any, and the pose that the pipeline published."""
    pipeline, out, serial = Pipeline(SlamConfig()), [], 0
    for m in messages:
        published = [e for e in pipeline.process(m) if isinstance(e, PosePublished)]
        estimate = deepcopy(pipeline.new_estimate(serial + 1))
        serial += estimate is not None
        out.append((estimate, values(published[0]) if published else None))
    return out


@settings(deadline=None, max_examples=40)
@given(FAULT_LISTS)
def test_each_message_that_the_pipeline_accepts_has_a_pose_at_its_stamp(faults: list[str]) -> None:
    messages, live = stream(faults), LivePose(CONFIG)
    for m, (estimate, published) in zip(messages, estimated(messages), strict=True):
        pose = live.add(m)
        assert (pose and (pose.stamp_ns, pose.T_odom_base)) == (published and (published[0], published[3]))
        if estimate:
            assert live.adopt(estimate) == []


@settings(deadline=None, max_examples=40)
@given(FAULT_LISTS, st.integers(0, 80), st.integers(0, 30))
def test_after_an_estimate_the_poses_are_the_same_whenever_it_came(faults: list[str], at: int, late: int) -> None:
    messages = stream(["sound", *faults])
    results = estimated(messages)
    at = max((k for k, (estimate, _) in enumerate(results) if estimate and k <= at), default=0)
    estimate, adopted_at = results[at][0], min(at + late, len(messages) - 1)
    assert estimate is not None
    at_once, later = LivePose(CONFIG), LivePose(CONFIG)
    for k, m in enumerate(messages):
        poses = at_once.add(m), later.add(m)
        assert k <= at or k > adopted_at or (poses[0] is None) is (poses[1] is None)
        assert k <= adopted_at or values(poses[0]) == values(poses[1])
        for live, moment in ((at_once, at), (later, adopted_at)):
            if k == moment:
                live.adopt(deepcopy(estimate))


def test_poses_that_were_held_back_while_the_laser_led_come_with_the_anchor() -> None:
    messages = stream(["sound"] * 6)
    estimate = estimated(messages[:1])[0][0]
    assert estimate is not None
    live, blind = LivePose(CONFIG), Estimate(1, deepcopy(estimate.odometry), None)
    live.add(messages[0])
    live.adopt(blind)
    assert [live.add(m) for m in messages[1:4]] == [None] * 3
    assert [pose.stamp_ns for pose in live.adopt(estimate)] == [m.stamp_ns for m in messages[1:4]]
    assert live.add(messages[4]) is not None


def test_in_a_known_map_nothing_is_published_while_no_pose_is_claimed() -> None:
    messages = stream(["sound"] * 6)
    estimate = estimated(messages[:1])[0][0]
    assert estimate is not None
    live, given_up = LivePose(CONFIG, begins_map=False), Estimate(2, deepcopy(estimate.odometry), None)
    assert [live.add(m) for m in messages[:2]] == [None] * 2
    assert [pose.stamp_ns for pose in live.adopt(deepcopy(estimate))] == [messages[1].stamp_ns]
    assert live.add(messages[2]) is not None
    assert live.adopt(given_up) == []
    assert [live.add(m) for m in messages[3:]] == [None] * 3


def test_an_estimate_is_due_as_soon_as_a_pose_is_claimed_or_given_up() -> None:
    schedule = EstimateSchedule()
    assert not schedule.is_due(0, 1, claimed=False)
    assert schedule.is_due(1, 2, claimed=False)
    assert schedule.is_due(1, 3, claimed=True)
    assert not schedule.is_due(1, 4, claimed=True)
    assert schedule.is_due(1, 5, claimed=False)
    assert schedule.is_due(1, 5 + ESTIMATE_EVERY, claimed=False)


def test_the_covariance_grows_along_the_way_and_an_unknown_motion_makes_it_uncertain() -> None:
    start = PathPoint(0, Pose2(), 0.0)
    anchor = Anchor(start, Pose2(3.0, 1.0, 0.7), ORIGIN_COVARIANCE, np.zeros(4), 1.0, State.TRACKING)
    near, far = (PathPoint(k, Pose2(0.1 * k, 0.0, 0.0), 0.1 * k) for k in (1, 20))
    sigmas = [np.linalg.eigvalsh(anchor.pose_at(p, p.T_path_base, CONFIG).covariance) for p in (near, far)]
    assert (sigmas[1] >= sigmas[0]).all()
    moved = PathPoint(1, Pose2(), 0.0, discontinuities=1)
    assert anchor.pose_at(near, Pose2(), CONFIG).state is State.TRACKING
    assert anchor.pose_at(moved, Pose2(), CONFIG).state is State.UNCERTAIN


def test_map_to_odom_takes_the_odometry_to_the_map() -> None:
    anchor = Anchor(PathPoint(0, Pose2(), 0.0), Pose2(3.0, 1.0, 0.7), ORIGIN_COVARIANCE, np.zeros(4), 1.0, State.LOST)
    T_odom_base = Pose2(-4.0, 2.0, 2.0)
    pose = anchor.pose_at(PathPoint(1, Pose2(0.2, 0.0, 0.1), 0.2), T_odom_base, CONFIG)
    np.testing.assert_allclose((pose.T_map_odom @ T_odom_base).array(), pose.T_map_base.array(), atol=1e-12)
    assert pose.state is State.LOST
