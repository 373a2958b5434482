"""The live pose of the daemon: given up at once where it is not claimed any more, and in the odometry's own frame."""

import time
from copy import deepcopy
from dataclasses import dataclass, field, replace
from typing import cast

import numpy as np
import pytest

from wayfi.backend.graph.health import State
from wayfi.backend.pose2 import Pose2
from wayfi.frontends.events import PosePublished
from wayfi.frontends.measurements import Odometry, Sensor
from wayfi.frontends.odometry.accepted_odometry import AcceptedOdometry
from wayfi.frontends.odometry.live_pose import ORIGIN_COVARIANCE, Anchor, Estimate
from wayfi.recordings.ros.codec import encode
from wayfi.recordings.ros.topics import Encoding
from wayfi.service.config import Config, load_config
from wayfi.service.daemon import live_publisher
from wayfi.service.daemon.diagnostics import Diagnostics
from wayfi.service.daemon.estimator_messages import Backlog
from wayfi.service.daemon.live_publisher import LivePublisher
from wayfi.service.transport.message_queue import MessageQueue, Received, limits_of
from wayfi.service.transport.publishers import Publishers


@dataclass
class Published:
    """Keeps what would be published."""

    poses: list[PosePublished] = field(default_factory=list)

    def publish_pose(self, event: PosePublished) -> None:
        self.poses.append(event)


class Daemon:
    """A live publisher with its diagnostics, and what it has published."""

    def __init__(self, config: Config, begins_map: bool = True) -> None:
        limits = limits_of(config.zenoh, config.recording.every_topic)
        self.diagnostics = Diagnostics(MessageQueue[Received](limits), Backlog(limits))
        self.published = Published()
        publishers = cast("Publishers", self.published)
        self.live = LivePublisher(config, None, publishers, self.diagnostics, begins_map)

    def hear(self, number: int, frame_id: str = "odom") -> None:
        data = encode(replace(odometry(number), frame_id=frame_id))
        self.live.handle(Received(Sensor.ODOM, "/odom", Encoding.CDR, data, time.monotonic()))

    def complaints(self) -> list[str]:
        values = self.diagnostics.status({}).values
        return [text for name, text in values.items() if name.startswith("complaint.")]


def odometry(number: int) -> Odometry:
    return Odometry((number + 1) * 100_000_000, Pose2(0.05 * number, 0.0, 0.0))


def test_a_pose_that_is_given_up_is_published_no_more_however_soon_after_an_adoption(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(live_publisher, "ADOPTION_PAUSE", 1e9)
    daemon = Daemon(load_config(), begins_map=False)
    accepted = AcceptedOdometry(load_config().odometry)
    point = accepted.accept(odometry(0)).point
    assert point is not None
    daemon.hear(0)
    assert not daemon.published.poses
    anchor = Anchor(point, Pose2(3.0, 4.0, 0.0), ORIGIN_COVARIANCE, np.zeros(4), 1.0, State.TRACKING)
    daemon.live.set_estimate(Estimate(1, deepcopy(accepted), anchor))
    assert daemon.live.adopt() == 1
    daemon.hear(1)
    assert [round(p.T_map_base.x, 3) for p in daemon.published.poses] == [3.05]
    accepted.accept(odometry(1))
    daemon.live.set_estimate(Estimate(2, deepcopy(accepted), anchor))
    assert daemon.live.adopt() is None
    daemon.live.set_estimate(Estimate(3, deepcopy(accepted), None))
    assert daemon.live.adopt() == 3
    daemon.hear(2)
    assert len(daemon.published.poses) == 1


def test_odometry_in_another_frame_than_tf_leads_to_is_complained_of_with_the_setting() -> None:
    daemon = Daemon(load_config())
    daemon.hear(0, "/robot1/odom")
    daemon.hear(1, "/robot1/odom")
    (text,) = daemon.complaints()
    assert text.endswith("--set frames.odom=robot1/odom")
    for settings, frame_id in (([], "odom"), (["frames.odom=robot1/odom"], "/robot1/odom"), ([], "")):
        fitting = Daemon(load_config((), settings))
        fitting.hear(0, frame_id)
        assert not fitting.complaints()
