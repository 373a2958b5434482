"""Publishes the live pose: one for each odometry message at once, based on the newest estimate."""

import time

from wayfi.frontends.calibration import Calibration
from wayfi.frontends.events import PosePublished, Warned
from wayfi.frontends.frames.frame_tree import frame_name
from wayfi.frontends.measurements import Odometry, Sensor
from wayfi.frontends.odometry.live_pose import Estimate, LivePose
from wayfi.recordings.ros.codec import decode
from wayfi.recordings.ros.codec_error import CodecError
from wayfi.service.config import Config
from wayfi.service.daemon.diagnostics import Diagnostics
from wayfi.service.transport.message_queue import Received
from wayfi.service.transport.publishers import Publishers

ADOPTION_PAUSE = 4.0  # times the duration of an adoption: adopting uses a fifth of the loop's time at most


class LivePublisher:
    """Publishes poses in the order of their stamps: one that is not newer than the last is left out."""

    def __init__(
        self,
        config: Config,
        calibration: Calibration | None,
        publishers: Publishers,
        diagnostics: Diagnostics,
        begins_map: bool = True,
    ) -> None:
        self._begins_map = begins_map
        self._config, self._frames = config.odometry, config.frames
        self._is_compared = False
        self._wheels = calibration.wheels if calibration else None
        self._publishers = publishers
        self._diagnostics = diagnostics
        self._published_ns = -1
        self.reset()

    def reset(self) -> None:
        """Start from a live pose without any estimate."""
        self._live = LivePose(self._config, self._wheels, self._begins_map)
        self._newest: Estimate | None = None
        self._adopt_from_s = 0.0

    @property
    def has_published(self) -> bool:
        """Whether a pose has been published."""
        return self._published_ns >= 0

    def handle(self, received: Received) -> None:
        """Publish the pose of an odometry message, if it can be decoded and is used."""
        try:
            odometry = decode(received.data, Sensor.ODOM, received.encoding)
        except CodecError:
            return
        assert isinstance(odometry, Odometry)
        self._compare_frames(odometry)
        pose = self._live.add(odometry)
        if pose is not None:
            self.publish(pose, received.received_s)

    def _compare_frames(self, odometry: Odometry) -> None:
        """Complain where the odometry is in another frame than the transform that is published leads to."""
        sent, published = frame_name(odometry.frame_id), frame_name(self._frames.odom)
        if self._is_compared or not sent:
            return
        self._is_compared = True
        if sent != published:
            told = f"the odometry is in {sent!r}, but {published!r} is what tf gets below {self._frames.map!r}"
            text = f"{told}: --set frames.odom={sent}"
            self._diagnostics.handle(Warned(odometry.stamp_ns, text, "odometry.frame"), time.monotonic())

    def publish(self, pose: PosePublished, received_s: float) -> None:
        """Publish a pose, whose message was received at `received_s`, monotonic."""
        if pose.stamp_ns > self._published_ns:
            self._published_ns = pose.stamp_ns
            self._publishers.publish_pose(pose)
            self._diagnostics.handle(pose, received_s)

    def set_estimate(self, estimate: Estimate) -> None:
        """Set the estimate to adopt next, in place of an earlier one that has not been adopted."""
        self._newest = estimate

    def adopt(self) -> int | None:
        """Base poses on the newest estimate and return its number; None where there is no newer one yet.

        After an adoption the next waits for `ADOPTION_PAUSE` times its duration, in which messages are handled. One
        that gives the pose up does not wait.
        """
        estimate, now_s = self._newest, time.monotonic()
        if estimate is None or (estimate.anchor is not None and now_s < self._adopt_from_s):
            return None
        self._newest = None
        for pose in self._live.adopt(estimate):
            self.publish(pose, now_s)
        end_s = time.monotonic()
        self._adopt_from_s = end_s + ADOPTION_PAUSE * (end_s - now_s)
        return estimate.serial
