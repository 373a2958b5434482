"""Zenoh out: pose, transform, and the latched map and status."""

from contextlib import ExitStack

import zenoh

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.events import PosePublished
from wayfi.frontends.frames.frames_config import FramesConfig
from wayfi.frontends.measurements import SECOND_NS
from wayfi.recordings.closing import Closing
from wayfi.recordings.ros.codec_error import CodecError
from wayfi.service.config import ZenohConfig
from wayfi.service.transport.latched_publisher import LatchedPublisher
from wayfi.service.transport.latest_value import LatestValue
from wayfi.service.transport.output_messages import (
    Status,
    common_pose_message,
    pose_message,
    status_message,
    transform_message,
)
from wayfi.service.transport.ros_publishers import AMCL_POSE, DIAGNOSTICS, MAP, POSE, TF, RosPublishers
from wayfi.service.transport.zenoh_session import key_of

CDR = zenoh.Encoding.APPLICATION_CDR
ALIVE = "wayfi/alive"


class Publishers(Closing):
    """Publishes under `wayfi/`, and to ROS 2 as `zenoh.ros` says; a context manager. No slow subscriber delays a pose.

    `unpublished` counts the poses whose stamp a ROS time cannot hold. `T_common_map` is where the map lies in that of a
    fleet: from when it is set, poses are published in that one too. Raises ZenohError.
    """

    def __init__(
        self,
        session: zenoh.Session,
        config: ZenohConfig,
        frames: FramesConfig = FramesConfig(),  # noqa: B008 - frozen
    ) -> None:
        self._session = session
        self._config = config
        self._frames = frames
        self._tf_ahead_ns = round(config.tf_ahead_s * SECOND_NS)
        self.unpublished = 0
        self.T_common_map: Pose2 | None = None
        urgent = zenoh.Priority.INTERACTIVE_HIGH
        with ExitStack() as opened:
            enter = opened.enter_context
            self._pose = enter(session.declare_publisher(self._key("pose"), encoding=CDR, priority=urgent))
            self._tf = enter(session.declare_publisher(self._key("tf"), encoding=CDR, priority=urgent))
            self._status = enter(LatchedPublisher(session, self._key("status"), zenoh.CongestionControl.DROP))
            self._map = enter(LatchedPublisher(session, self._key("map"), zenoh.CongestionControl.BLOCK))
            self._common_pose = enter(session.declare_publisher(self._key("common/pose"), encoding=CDR))
            self._common_map = enter(LatchedPublisher(session, self._key("common/map"), zenoh.CongestionControl.BLOCK))
            self._ros = enter(RosPublishers(session, config))
            self._maps = enter(LatestValue(self._put_map))
            self._opened = opened.pop_all()

    def close(self) -> None:
        """Undeclare everything."""
        self._opened.close()

    def announce(self) -> zenoh.LivelinessToken:
        """Declare that the daemon is ready, as long as the returned token, a context manager, is open."""
        return self._session.liveliness().declare_token(key_of(self._config, ALIVE))

    def publish_map(self, data: bytes) -> None:
        """Publish the map, an OccupancyGrid in CDR; a slow subscriber delays the next map and nothing else."""
        self._maps.put(data)

    def publish_common_map(self, data: bytes) -> None:
        """Publish the map of the fleet, an OccupancyGrid in CDR; waits for a slow subscriber."""
        self._common_map.put(data)

    def publish_status(self, stamp_ns: int, status: Status) -> None:
        """Publish the status, as of `stamp_ns` on the wall clock."""
        data = status_message(stamp_ns, status)
        self._status.put(data)
        self._ros.put(DIAGNOSTICS, data)

    def publish_pose(self, event: PosePublished) -> None:
        """Publish a pose and its transform map -> odom.

        On ROS 2's own /tf the transform is stamped `zenoh.tf_ahead_s` later, as AMCL does it with its tolerance.
        """
        T = self.T_common_map
        try:
            pose, transform = pose_message(event, self._frames), transform_message(event, self._frames, 0, T)
            lasting = transform_message(event, self._frames, self._tf_ahead_ns, T)
            in_common = common_pose_message(event, T, self._frames) if T else None
        except CodecError:
            self.unpublished += 1
            return
        self._pose.put(pose)
        self._tf.put(transform)
        self._ros.put(POSE, pose)
        self._ros.put(AMCL_POSE, pose)
        self._ros.put(TF, lasting)
        if in_common is not None:
            self._common_pose.put(in_common)

    def _put_map(self, data: bytes) -> None:
        self._map.put(data)
        self._ros.put(MAP, data)

    def _key(self, name: str) -> str:
        return key_of(self._config, f"wayfi/{name}")
