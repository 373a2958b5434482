"""Publishes the pose in `map` of each odometry message: at once, or as soon as a pose is claimed."""

from collections.abc import Callable, Iterator

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.events import PosePublished
from wayfi.frontends.odometry.driven_path import PathPoint
from wayfi.frontends.odometry.live_pose import Anchor
from wayfi.frontends.odometry.odometry_config import OdometryConfig
from wayfi.frontends.odometry.trajectories import Trajectories

GetAnchor = Callable[[], Anchor | None]


class PosePublisher:
    """Keeps the `trajectories` of a drive, or of a part of it, as it was published.

    It `waits` while there is no pose for the newest message, because none was claimed when it came.
    """

    def __init__(self, config: OdometryConfig) -> None:
        self._config = config
        self.trajectories = Trajectories()
        self._waiting: tuple[PathPoint, Pose2] | None = None

    @property
    def waits(self) -> bool:
        """Whether there is no pose yet for the newest message."""
        return self._waiting is not None

    def add(
        self, point: PathPoint, T_odom_base: Pose2, anchor: GetAnchor, published: PosePublished | None
    ) -> Iterator[PosePublished]:
        """Publish the pose at the path's newest `point`, which is `published` already if that is its pose."""
        if published is None or published.stamp_ns != point.stamp_ns:
            published = self._pose(point, T_odom_base, anchor())
        self.trajectories.add(point, published.T_map_base if published else None)
        self._waiting = None if published else (point, T_odom_base)
        yield from (published,) if published else ()

    def catch_up(self, anchor: GetAnchor) -> Iterator[PosePublished]:
        """Publish the pose of the newest message if it waits, and one is claimed by now."""
        if self._waiting and (published := self._pose(*self._waiting, anchor())):
            self.trajectories.publish_newest(published.T_map_base)
            self._waiting = None
            yield published

    def _pose(self, point: PathPoint, T_odom_base: Pose2, anchor: Anchor | None) -> PosePublished | None:
        return anchor.pose_at(point, T_odom_base, self._config) if anchor else None
