"""Odometry that is in /tf: the pose of the base in a frame called odom, kept for as long as no messages come."""

from collections import deque
from itertools import pairwise

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.frames.frame_tree import frame_name, leaf_name
from wayfi.frontends.frames.pose3 import heading
from wayfi.frontends.measurements import PAUSE_NS, MovingTransforms, Odometry

ODOM = "odom"  # within the name of the parent: odom, odom_combined, wheel_odom
MOST_WAITING = 3000  # poses, to bound memory: 10 s at 300 Hz


class TransformOdometry:
    """The poses that wait, oldest first; those of the first two frames that can be the odometry's and the base."""

    def __init__(self) -> None:
        self._frames: tuple[str, str] | None = None
        self._since_ns = -1
        self._waiting: deque[Odometry] = deque(maxlen=MOST_WAITING)

    def add(self, m: MovingTransforms) -> None:
        """Add the pose in a message, if there is one."""
        for t, stamp_ns in zip(m.transforms, m.stamps_ns, strict=True):
            frames = frame_name(t.frame_id), frame_name(t.child_frame_id)
            if self._frames is None and _is_odometry(*frames):
                self._frames = frames
            if frames == self._frames:
                if stamp_ns <= self._since_ns:
                    self._waiting.clear()
                x, y, _ = t.translation_xyz
                self._waiting.append(Odometry(stamp_ns, Pose2(x, y, heading(t.rotation_xyzw)), None, *frames))

    @property
    def named(self) -> str:
        """The two frames, for a warning."""
        return "{!r} to {!r}".format(*self._frames) if self._frames else ""

    def take(self) -> list[Odometry]:
        """Remove and return the poses that wait."""
        poses = list(self._waiting)
        self._waiting.clear()
        return poses

    def restart(self, stamp_ns: int) -> None:
        """A message has come: poses of later than `stamp_ns` wait, and the last one of before, which they join."""
        self._since_ns = stamp_ns
        while len(self._waiting) > 1 and self._waiting[1].stamp_ns <= stamp_ns:
            self._waiting.popleft()

    @property
    def waited_ns(self) -> int:
        """From the oldest pose that waits to the newest; a pause between two of them counts for a second at most."""
        return sum(min(max(b.stamp_ns - a.stamp_ns, 0), PAUSE_NS) for a, b in pairwise(self._waiting))


def _is_odometry(parent: str, child: str) -> bool:
    """Whether the transform between two frames is odometry, by their names."""
    return ODOM in leaf_name(parent).lower() and ODOM not in leaf_name(child).lower()
