"""What the status says: the state of the newest pose, for as long as that tells where the robot is."""

import numpy as np
import pytest
from live.clocks import Clock

from wayfi.backend.graph.health import State
from wayfi.backend.pose2 import Pose2
from wayfi.frontends.events import PosePublished, StateChanged
from wayfi.service.config import load_config
from wayfi.service.daemon import diagnostics
from wayfi.service.daemon.diagnostics import STALE_S, Diagnostics
from wayfi.service.transport.message_queue import MessageQueue, limits_of


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    clock = Clock()
    monkeypatch.setattr(diagnostics, "time", clock)
    return clock


def new_diagnostics() -> Diagnostics:
    config = load_config()
    limits = limits_of(config.zenoh, config.recording.every_topic)
    return Diagnostics(MessageQueue(limits), MessageQueue(limits))


def pose(state: State) -> PosePublished:
    return PosePublished(0, Pose2(), Pose2(), Pose2(), 1e-4 * np.eye(3), state)


def test_a_robot_is_tracked_for_about_a_second_after_a_pose(clock: Clock) -> None:
    status = new_diagnostics()
    status.handle(pose(State.TRACKING), clock.now_s)
    assert status.status({}).values["state"] == State.TRACKING
    clock.now_s += 0.9 * STALE_S
    status.status({})
    assert not status.due()
    clock.now_s += 0.2 * STALE_S
    assert status.due()
    told = status.status({})
    assert told.values["state"] == State.UNCERTAIN
    assert told.values["reason"].startswith("no pose for 1.")
    status.handle(pose(State.TRACKING), clock.now_s)
    assert status.due()
    assert status.status({}).values["state"] == State.TRACKING


@pytest.mark.parametrize("state", [State.UNCERTAIN, State.LOST, State.RELOCALISING])
def test_a_state_that_claims_less_keeps_its_reason(state: State, clock: Clock) -> None:
    status = new_diagnostics()
    status.handle(pose(State.TRACKING), clock.now_s)
    status.handle(StateChanged(0, state, "two halls look alike"), clock.now_s)
    clock.now_s += 60.0
    told = status.status({})
    assert (told.values["state"], told.values["reason"]) == (state, "two halls look alike")
