"""The tree of fixed transforms: in any number of messages, in any order, each in either direction."""

import math
from collections import deque
from dataclasses import dataclass
from enum import Enum

from wayfi.frontends.frames.pose3 import Pose3
from wayfi.frontends.measurements import Transform

MOST_FRAMES = 1000  # to bound memory: humanoids have some hundred
MOST_CHANGES = 3  # of one transform that was said to be fixed: calibrated anew while the robot runs
FURTHEST_M = 100.0  # of one frame from another: larger than any robot indoors
SMALLEST_NORM, LARGEST_NORM = 1e-3, 1e3  # of a quaternion, which should be 1: it can be normalised without overflow
STILL_M, STILL_RAD = 1e-3, 1e-3  # less is rounding, and nothing that a laser sees

Pair = tuple[str, str]


class Added(Enum):
    """What became of a transform that was added to the tree."""

    NEW = "joins two frames"
    KNOWN = "was known"
    CHANGED = "takes the place of another"
    MOVES = "moves: it is no part of the tree"
    RESTLESS = "changes again and again; the last one is kept"
    LOOP = "contradicts another way between the two frames, which came first and is kept"
    ABSURD = "cannot be: it is too far, has no rotation, or does not lead from one named frame to another"
    NON_FINITE = "has numbers that are not finite"
    TOO_MANY = "is one too many"


def frame_name(name: str) -> str:
    """A frame's name without its leading slash, which ROS 1 wrote."""
    return name.lstrip("/")


def leaf_name(frame: str) -> str:
    """A frame's name without the namespaces before it: `base_link` of `robot1/base_link`."""
    return frame.rsplit("/", 1)[-1]


@dataclass(frozen=True, slots=True, eq=False)
class _Joint:
    """How a frame is joined to another: the other's pose in it, and whether that was declared to be fixed."""

    T: Pose3
    declared: bool


class FrameTree:
    """Frames joined by fixed transforms. Memory is bounded.

    Those declared to be fixed make a tree: between two frames there is one way at most. Where that does not lead, those
    of /tf are used as well, as long as they have never changed. `version` counts the changes.
    """

    def __init__(self) -> None:
        self.version = 0
        self._joints: dict[str, dict[str, _Joint]] = {}
        self._given: dict[Pair, Transform] = {}
        self._changes: dict[Pair, int] = {}
        self._moving: set[Pair] = set()

    def __contains__(self, frame: str) -> bool:
        return frame in self._joints

    @property
    def frames(self) -> list[str]:
        """The frames that are joined to others, in the order in which they became known."""
        return list(self._joints)

    @property
    def pairs(self) -> list[Pair]:
        """Parent and child of each transform that is used, as it was given."""
        return list(self._given)

    def add(self, t: Transform, declared: bool = True) -> Added:
        """Add a transform: one `declared` to be fixed, or one of /tf, which is as long as it never changes."""
        pair = frame_name(t.frame_id), frame_name(t.child_frame_id)
        known = self._joints.get(pair[0], {}).get(pair[1])
        if known and known.declared >= declared and self._given.get(pair) == t:
            return Added.KNOWN
        if not declared and pair in self._moving:
            return Added.MOVES
        if fault := _fault_of(pair, t):
            return fault
        T = Pose3.of(t)
        return self._add_declared(pair, t, T, known) if declared else self._add_observed(pair, t, T, known)

    def between(self, parent: str, child: str) -> Pose3 | None:
        """T_parent_child: the pose of `child` in `parent`; None where no way leads from one to the other."""
        if parent not in self._joints or child not in self._joints:
            return None
        return self._way(parent, child, declared=True) or self._way(parent, child, declared=False)

    def _way(self, parent: str, child: str, declared: bool) -> Pose3 | None:
        """The shortest way, over transforms that are `declared` to be fixed alone if that is set."""
        reached = {parent: Pose3.identity()}
        waiting = deque([parent])
        while waiting and child not in reached:
            frame = waiting.popleft()
            for following, joint in self._joints[frame].items():
                if following not in reached and joint.declared >= declared:
                    reached[following] = reached[frame] @ joint.T
                    waiting.append(following)
        return reached.get(child)

    def _add_declared(self, pair: Pair, t: Transform, T: Pose3, known: _Joint | None) -> Added:
        if known and known.declared:
            return self._replace(pair, t, T, known)
        way = self._way(*pair, declared=True) if pair[0] in self and pair[1] in self else None
        if way:
            return Added.LOOP if T.differs(way, STILL_M, STILL_RAD) else Added.KNOWN
        if known:
            self._part(pair)
        return self._join(pair, t, _Joint(T, declared=True))

    def _add_observed(self, pair: Pair, t: Transform, T: Pose3, known: _Joint | None) -> Added:
        if known is None:
            return self._join(pair, t, _Joint(T, declared=False))
        if known.declared or not T.differs(known.T, STILL_M, STILL_RAD):
            return Added.KNOWN
        self._part(pair)
        self._moving.add(pair)
        return Added.MOVES

    def _replace(self, pair: Pair, t: Transform, T: Pose3, known: _Joint) -> Added:
        """Put a declared transform in the place of one, if it differs."""
        if not T.differs(known.T, STILL_M, STILL_RAD):
            return Added.KNOWN
        changes = self._changes.get(pair, 0) + 1
        if changes > MOST_CHANGES:
            return Added.RESTLESS
        self._part(pair)
        self._join(pair, t, _Joint(T, declared=True))
        self._changes[pair] = changes
        return Added.CHANGED

    def _join(self, pair: Pair, t: Transform, joint: _Joint) -> Added:
        if len(self._given) + len(self._moving) >= MOST_FRAMES:
            return Added.TOO_MANY
        parent, child = pair
        self._joints.setdefault(parent, {})[child] = joint
        self._joints.setdefault(child, {})[parent] = _Joint(joint.T.inverse(), joint.declared)
        self._given[pair] = t
        self.version += 1
        return Added.NEW

    def _part(self, pair: Pair) -> None:
        for a, b in (pair, pair[::-1]):
            del self._joints[a][b]
            if not self._joints[a]:
                del self._joints[a]
            self._given.pop((a, b), None)
            self._changes.pop((a, b), None)
        self.version += 1


def _fault_of(pair: Pair, t: Transform) -> Added | None:
    """Why a transform cannot be used; None if it can."""
    away_m, norm = math.hypot(*t.translation_xyz), math.hypot(*t.rotation_xyzw)
    if not (math.isfinite(away_m) and math.isfinite(norm)):
        return Added.NON_FINITE
    possible = away_m <= FURTHEST_M and SMALLEST_NORM <= norm <= LARGEST_NORM
    return None if possible and all(pair) and pair[0] != pair[1] else Added.ABSURD
