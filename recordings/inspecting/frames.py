"""The robot's frames as a tree, and where what the recording needs is missing from it."""

from collections.abc import Iterator
from dataclasses import dataclass

from wayfi.frontends.events import Warned
from wayfi.frontends.frames.frame_tree import frame_name
from wayfi.frontends.intake.mounts import Mounts
from wayfi.frontends.lidar.lidar_config import LidarConfig
from wayfi.frontends.measurements import MovingTransforms, Odometry, StaticTransforms, Sweep


@dataclass(frozen=True, slots=True)
class FrameInspection:
    """A fixed transform of the tree: `parent` is empty for a frame at the top, and `depth` counts from there.

    `mount` is x, y (m) and theta (rad) of a frame in the base, None where no transforms lead there. `of` is whose frame
    it is: of the odometry's pose, or of a laser.
    """

    frame: str
    parent: str
    depth: int
    mount: tuple[float, float, float] | None
    of: str


class Frames:
    """Gathers the fixed transforms, and the frames that the sensors name."""

    def __init__(self, config: LidarConfig, base_frame: str) -> None:
        self.mounts = Mounts(config, base_frame)
        self._base = frame_name(base_frame)
        self._sweeps: dict[str, Sweep] = {}
        self._faults: list[str] = []

    def add(self, m: StaticTransforms | MovingTransforms | Odometry | Sweep) -> None:
        """Add a message."""
        if isinstance(m, StaticTransforms | MovingTransforms):
            self._faults += [event.text for event in self.mounts.learn(m) if isinstance(event, Warned)]
        elif isinstance(m, Odometry):
            if not self._base:
                self._base = frame_name(m.child_frame_id)
                self.mounts.follow_odometry(m.child_frame_id)
        else:
            self._sweeps.setdefault(frame_name(m.frame_id), m)

    def missing(self) -> list[str]:
        """What is wrong or missing, as the pipeline says it."""
        unknown = [event for sweep in self._sweeps.values() for event in self.mounts.warn_of_unknown(sweep)]
        return self._faults + [event.text for event in unknown if isinstance(event, Warned)]

    def inspection(self) -> tuple[FrameInspection, ...]:
        """The frames from each top down; those that sensors name are there as well where nothing joins them."""
        children: dict[str, list[str]] = {}
        for parent, child in self.mounts.tree.pairs:
            children.setdefault(parent, []).append(child)
        joined = {child for each in children.values() for child in each}
        tops = [frame for frame in children if frame not in joined]
        named = [frame for frame in (self._base, *self._sweeps) if frame and frame not in joined | set(children)]
        return tuple(self._down_from([*tops, *named], children))

    def _down_from(self, tops: list[str], children: dict[str, list[str]]) -> Iterator[FrameInspection]:
        """Each frame once, before those below it."""
        waiting = [(frame, "", 0) for frame in reversed(tops)]
        seen: set[str] = set()
        while waiting:
            frame, parent, depth = waiting.pop()
            if frame in seen:
                continue
            seen.add(frame)
            yield FrameInspection(frame, parent, depth, self._mount(frame), self._of(frame))
            waiting += [(child, frame, depth + 1) for child in reversed(children.get(frame, []))]

    def _mount(self, frame: str) -> tuple[float, float, float] | None:
        if not self.mounts.knows(frame):
            return None
        T = self.mounts.of(frame).planar
        return float(T.x), float(T.y), float(T.theta)

    def _of(self, frame: str) -> str:
        return "odometry" if frame == self._base else "laser" if frame in self._sweeps else ""
