"""Which of several sources on the odometry's topic is followed: the first, as long as it sends."""

from wayfi.frontends.frames.frame_tree import frame_name
from wayfi.frontends.measurements import SECOND_NS, Odometry

MOST_TOLD = 8  # sources that are named, to bound memory: a robot was seen to have two
LEAST_MESSAGES = 5  # of another source, all of them since the one that is followed fell silent: not one broken name

Frames = tuple[str, str]


class OdometrySource:
    """Tells the sources by their frames; another takes over where the one that is followed is `silent_s` behind it."""

    def __init__(self, silent_s: float) -> None:
        self._silent_ns = round(silent_s * SECOND_NS)
        self._followed: Frames | None = None
        self._last_ns = 0
        self._others_since: list[Frames] = []
        self._told: set[Frames] = set()

    def follows(self, m: Odometry) -> tuple[bool, str]:
        """Whether a message is of the source that is followed, and what is to be told."""
        frames = frame_name(m.frame_id), frame_name(m.child_frame_id)
        if self._followed is None or frames == self._followed:
            self._follow(frames, m.stamp_ns)
            return True, ""
        self._others_since = [*self._others_since[1 - LEAST_MESSAGES :], frames]
        silent = m.stamp_ns - self._last_ns > self._silent_ns
        if silent and self._others_since == [frames] * LEAST_MESSAGES:
            before = self._followed
            self._follow(frames, m.stamp_ns)
            return True, f"the odometry of {_named(before)} is silent: that of {_named(frames)} is used from here on"
        return False, self._tell(frames)

    def _follow(self, frames: Frames, stamp_ns: int) -> None:
        self._followed, self._last_ns = frames, stamp_ns
        self._others_since = []

    def _tell(self, frames: Frames) -> str:
        """What is said of a source that is not followed: once, if it is not a single message."""
        if frames in self._told or len(self._told) >= MOST_TOLD or self._followed is None:
            return ""
        self._told.add(frames)
        kind = "child frame" if frames[1] != self._followed[1] else "frame"
        other, first = _named(frames), _named(self._followed)
        return f"a second source of odometry, with another {kind} ({other}), is not used: the first ({first}) is"


def _named(frames: Frames) -> str:
    frame, child = frames
    return f"{child!r} in {frame!r}"
