"""Where lasers are mounted on the base: by the transforms that lead there, or by the configuration."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.events import Dropped, DropReason, Event, Warned
from wayfi.frontends.frames.frame_tree import FURTHEST_M, STILL_M, STILL_RAD, Added, FrameTree, frame_name, leaf_name
from wayfi.frontends.frames.pose3 import Pose3
from wayfi.frontends.lidar.lidar_config import LidarConfig
from wayfi.frontends.lidar.mount import Mount
from wayfi.frontends.measurements import (
    MovingTransforms,
    PointCloud,
    Sensor,
    StaticTransforms,
    Sweep,
    Transform,
)

BASES = ("base_link", "base_footprint", "base")  # REP 105's and REP 120's names, and what some robots have instead
MOST_WARNED = 32  # frames whose mounts are warned of and watched for changes, to bound memory
MOST_NAMED = 12  # frames in a warning
DROPS = {
    Added.NON_FINITE: DropReason.NON_FINITE,
    Added.ABSURD: DropReason.ABSURD_MOUNT,
    Added.LOOP: DropReason.LOOP_OF_FRAMES,
    Added.RESTLESS: DropReason.RESTLESS_MOUNT,
    Added.TOO_MANY: DropReason.TOO_MANY_FRAMES,
}
FAULTS = {reason: added for added, reason in DROPS.items()}


@dataclass(frozen=True, slots=True, eq=False)
class _Used:
    """The mount that sweeps of a frame were placed with, None for base_link assumed; heights matter to clouds alone."""

    mount: Mount | None
    spatial: bool

    def differs(self, mount: Mount | None) -> bool:
        """Whether sweeps placed with `mount` lie elsewhere."""
        known, now = (self._flat(m or Mount.identity()) for m in (self.mount, mount))
        return known.differs(now, STILL_M, STILL_RAD)

    def _flat(self, mount: Mount) -> Pose3:
        x, y, z = mount.translation
        return Pose3(mount.rotation, np.array([x, y, z if self.spatial else 0.0]))


class Mounts:
    """The mount of each laser by its frame: where the `tree` leads to it from the base.

    The base is `base_frame`, if that is set, else the frame whose pose the odometry gives.
    """

    def __init__(self, config: LidarConfig, base_frame: str = "") -> None:
        self._configured = Pose2.of(config.mount) if config.mount else None
        self._base = self._set_base = frame_name(base_frame)
        self.tree = FrameTree()
        self._known: dict[str, Mount | None] = {}
        self._known_version = 0, self._base
        self._checked = self._known_version
        self._settled: set[str] = set()
        self._used: dict[str, _Used] = {}
        self._told: set[str] = set()

    def learn(self, m: StaticTransforms | MovingTransforms) -> Iterator[Event]:
        """Learn from a message; gives the drops of transforms that cannot be used."""
        declared = isinstance(m, StaticTransforms)
        for t in m.transforms:
            if (reason := self.add(t, declared)) is None:
                continue
            yield Dropped(Sensor.TF_STATIC if declared else Sensor.TF, m.stamp_ns, reason)
            text = f"transform from {t.frame_id!r} to {t.child_frame_id!r} is not used: it {FAULTS[reason].value}"
            if self._is_new(text):
                yield Warned(m.stamp_ns, text)

    def add(self, t: Transform, declared: bool = True) -> DropReason | None:
        """Learn a transform that was `declared` to be fixed, or one of /tf; returns why it is dropped, if it is."""
        added = self.tree.add(t, declared)
        if added is Added.ABSURD and not declared:
            return None  # of frames like map and odom, which may be far apart
        return DROPS.get(added)

    def follow_odometry(self, child_frame_id: str) -> None:
        """The odometry gives the pose of this frame."""
        if not self._set_base:
            self._base = frame_name(child_frame_id)

    def of(self, frame_id: str, height_m: float = 0.0) -> Mount:
        """The mount of a frame; upright at base_link where none is known. An unknown height is `height_m`."""
        if self._configured:
            return Mount.level(self._configured, height_m)
        return self._mount(frame_name(frame_id)) or Mount.level(Pose2(), height_m)

    def knows(self, frame_id: str) -> bool:
        """Whether the mount of a frame is known."""
        frame = frame_name(frame_id)
        at_base = leaf_name(frame) in BASES or frame == self._base
        return self._configured is not None or at_base or self._mount(frame) is not None

    def warn_of_unknown(self, sweep: Sweep) -> Iterator[Event]:
        """Warn once of a frame whose mount is not known, or known for another base than the odometry's."""
        frame = frame_name(sweep.frame_id)
        text = self._doubtful(frame)
        if text and self._is_new(frame):
            yield Warned(sweep.stamp_ns, text)

    def settle(self, frame_id: str) -> None:
        """Let no sweep of this frame wait for its mount any more."""
        if len(self._settled) < MOST_WARNED:
            self._settled.add(frame_name(frame_id))

    def awaits(self, frame_id: str) -> bool:
        """Whether the mount of a frame is not known yet, and its sweeps are to wait for it."""
        settled = frame_name(frame_id) in self._settled or len(self._settled) >= MOST_WARNED
        return not (settled or self.knows(frame_id))

    def mark_used(self, sweep: Sweep) -> None:
        """Note that a sweep is placed with the mount of its frame as it is known now."""
        frame = frame_name(sweep.frame_id)
        if self._configured is None and frame not in self._used and len(self._used) < MOST_WARNED:
            self._used[frame] = _Used(self._mount(frame), isinstance(sweep, PointCloud))

    def changes(self) -> list[str]:
        """What has changed of the mounts that sweeps were placed with, a sentence for each frame; told once."""
        said: list[str] = []
        version = self.tree.version, self._base
        if version == self._checked:
            return said
        self._checked = version
        for frame, used in self._used.items():
            mount = self._mount(frame)
            if used.differs(mount):
                said.append(_change(frame, used.mount, mount))
            if mount is not used.mount:
                self._used[frame] = _Used(mount, used.spatial)
        return said

    def _mount(self, frame: str) -> Mount | None:
        """The mount of a frame by the transforms; None where none lead there."""
        version = self.tree.version, self._base
        if version != self._known_version or len(self._known) >= MOST_WARNED:
            self._known, self._known_version = {}, version
        if frame not in self._known:
            self._known[frame] = next((mount for _, mount in self._ways(frame)), None)
        return self._known[frame]

    def _ways(self, frame: str) -> Iterator[tuple[str, Mount]]:
        """The frames from which transforms lead to `frame` and which may be the base, likeliest first, each with it."""
        known = sorted((f for f in self.tree.frames if leaf_name(f) in BASES), key=lambda f: BASES.index(leaf_name(f)))
        for base in dict.fromkeys([self._base, *known]):
            T = self.tree.between(base, frame)
            if T is not None and math.hypot(*T.translation) <= FURTHEST_M:
                yield base, Mount(T.rotation, T.translation)

    def _doubtful(self, frame: str) -> str:
        """What is doubtful about the mount of a frame; empty where nothing is."""
        base = self._base or BASES[0]
        if not self.knows(frame):
            if not self.tree.frames:
                return f"no /tf_static says where {frame!r} is mounted; base_link is assumed (see lidar.mount)"
            known = f"known are {_named(self.tree.frames)}"
            return f"no transform leads from {base!r} to {frame!r}: {known}; base_link is assumed (see lidar.mount)"
        found = next((other for other, _ in self._ways(frame)), base) if self._configured is None else base
        if self._base and found != base:
            broken = f"no transform leads from {base!r}, whose pose the odometry gives, to {frame!r}"
            return f"{broken}; {found!r} is taken for it (--set odometry.base_frame={found})"
        return ""

    def _is_new(self, text: str) -> bool:
        """Whether nothing has been told under `text` so far, and there is room to remember that."""
        if text in self._told or len(self._told) >= MOST_WARNED:
            return False
        self._told.add(text)
        return True


def _change(frame: str, before: Mount | None, now: Mount | None) -> str:
    if now is None:
        return f"the way to {frame!r} moves: its mount is not known, base_link is assumed (see lidar.mount)"
    T = now.planar
    place = f"({T.x:.2f} m, {T.y:.2f} m, {T.theta:+.2f} rad)"
    return f"the mount of {frame!r} {'changed to' if before else 'is known only now:'} {place}"


def _named(frames: list[str]) -> str:
    more = len(frames) - MOST_NAMED
    return ", ".join(map(repr, frames[:MOST_NAMED])) + (f" and {more} more" if more > 0 else "")
