"""Publishes the live pose: for each odometry message at once, on the newest estimate that is known."""

import time

from wayfi.frontends.events import PosePublished
from wayfi.frontends.measurements import Odometry, Sensor
from wayfi.frontends.odometry.live_pose import Estimate, LivePose
from wayfi.recordings.ros.codec import decode
from wayfi.recordings.ros.codec_error import CodecError
from wayfi.service.daemon.diagnostics import Diagnostics
from wayfi.service.transport.message_queue import Received
from wayfi.service.transport.publishers import Publishers


class LivePublisher:
    """Never publishes a pose that is older than the last; `has_published` says whether there was one."""

    def __init__(self, live: LivePose, publishers: Publishers, diagnostics: Diagnostics) -> None:
        self._publishers = publishers
        self._diagnostics = diagnostics
        self._published_ns = -1
        self.begin(live)

    def begin(self, live: LivePose) -> None:
        """Go on with another live pose, which knows nothing yet."""
        self._live = live
        self._newest: Estimate | None = None
        self._adopt_from_s = 0.0

    @property
    def has_published(self) -> bool:
        """Whether a pose has been published."""
        return self._published_ns >= 0

    def take(self, received: Received) -> None:
        """Publish the pose of an odometry message; one that cannot be decoded has none."""
        try:
            odometry = decode(received.data, Sensor.ODOM, received.encoding)
        except CodecError:
            return
        assert isinstance(odometry, Odometry)
        pose = self._live.take(odometry)
        if pose is not None:
            self.publish(pose, received.received_s)

    def publish(self, pose: PosePublished, received_s: float) -> None:
        """Publish a pose, whose message was received at `received_s` of the monotonic clock."""
        if pose.stamp_ns > self._published_ns:
            self._published_ns = pose.stamp_ns
            self._publishers.publish_pose(pose)
            self._diagnostics.take(pose, received_s)

    def know(self, estimate: Estimate) -> None:
        """This estimate is to be adopted, in place of one before that has not been yet."""
        self._newest = estimate

    def adopt(self) -> int | None:
        """Use the newest estimate and return its number, None where there is no other.

        Where that takes long, messages come first four fifths of the time.
        """
        estimate, now_s = self._newest, time.monotonic()
        if estimate is None or now_s < self._adopt_from_s:
            return None
        self._newest = None
        for pose in self._live.adopt(estimate):
            self.publish(pose, now_s)
        end_s = time.monotonic()
        self._adopt_from_s = end_s + 4 * (end_s - now_s)
        return estimate.serial
