"""Where lasers are mounted on the base, by /tf_static or the configuration."""

import math
from collections.abc import Iterator

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.events import DropReason, Event, Warned
from wayfi.frontends.lidar.lidar_config import LidarConfig
from wayfi.frontends.lidar.mount import Mount
from wayfi.frontends.measurements import StaticTransform, Sweep

BASE_FRAME = "base_link"
MOST_FRAMES = 100  # whose mounts are remembered, to bound memory; robots carry a few sensors
MOST_WARNED = 32  # frames without a mount, as above
FURTHEST_M = 100.0  # of a mount from the base: larger than any robot indoors
SMALLEST_NORM, LARGEST_NORM = 1e-3, 1e3  # of a quaternion, which should be 1: it can be normalised without overflow


class Mounts:
    """The mount of each laser by its frame."""

    def __init__(self, config: LidarConfig) -> None:
        self._configured = Pose2.of(config.mount) if config.mount else None
        self._mounts: dict[str, Mount] = {}
        self._warned: set[str] = set()

    def add(self, t: StaticTransform) -> DropReason | None:
        """Learn where a sensor is mounted on the base; returns why it is not, if it is not."""
        away_m, norm = math.hypot(*t.translation_xyz), math.hypot(*t.rotation_xyzw)
        if not (math.isfinite(away_m) and math.isfinite(norm)):
            return DropReason.NON_FINITE
        if away_m > FURTHEST_M or not SMALLEST_NORM <= norm <= LARGEST_NORM:
            return DropReason.ABSURD_MOUNT
        if len(self._mounts) >= MOST_FRAMES and t.child_frame_id not in self._mounts:
            return DropReason.TOO_MANY_FRAMES
        self._mounts[t.child_frame_id] = Mount.of(t)
        return None

    def of(self, frame_id: str, height_m: float = 0.0) -> Mount:
        """The mount of a frame; upright at base_link where none is known. An unknown height is `height_m`."""
        if self._configured:
            return Mount.level(self._configured, height_m)
        return self._mounts.get(frame_id) or Mount.level(Pose2(), height_m)

    def knows(self, frame_id: str) -> bool:
        """Whether the mount of a frame is known."""
        return self._configured is not None or frame_id in self._mounts or frame_id == BASE_FRAME

    def warn_of_unknown(self, sweep: Sweep) -> Iterator[Event]:
        """Warn once of a frame whose mount is not known."""
        frame_id = sweep.frame_id
        if self.knows(frame_id) or frame_id in self._warned or len(self._warned) >= MOST_WARNED:
            return
        self._warned.add(frame_id)
        text = f"no /tf_static says where {frame_id!r} is mounted; base_link is assumed (see lidar.mount)"
        yield Warned(sweep.stamp_ns, text)
