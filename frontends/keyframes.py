"""The keyframes: when one is due, where each stands on the driven path, and the scan it holds."""

from bisect import bisect_right
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.graph.wheel_calibration import WheelMotion
from wayfi.backend.pose2 import Floats, between_all
from wayfi.frontends.odometry.driven_path import PathPoint
from wayfi.frontends.odometry.odometry_config import OdometryConfig
from wayfi.frontends.odometry.trajectories import Trajectories
from wayfi.frontends.scan_points import ScanPoints


@dataclass(frozen=True, slots=True, eq=False)
class Keyframe:
    """A base pose kept in the graph. `scan` is None where there is no laser, or none of its beams returned."""

    point: PathPoint
    scan: ScanPoints | None


class Keyframes:
    """Keyframes 0, 1, ... in the order of the graph; the drive's own, from `first` on, follow those of a map."""

    def __init__(self) -> None:
        self._keyframes: list[Keyframe] = []
        self._paths = np.empty(64)
        self._has_scan = np.zeros(64, np.bool_)
        self._floors = np.zeros(64, np.int64)
        self._pieces = [0]
        self.first = self.floor = 0
        self.joined = True  # whether the drive's own keyframes are known to be where `poses` puts them among the map's
        self._unknown_m = 0.0

    def __len__(self) -> int:
        return len(self._keyframes)

    def __getitem__(self, number: int) -> Keyframe:
        return self._keyframes[number]

    def __iter__(self) -> Iterator[Keyframe]:
        return iter(self._keyframes)

    @property
    def own(self) -> list[Keyframe]:
        """The drive's own keyframes."""
        return self._keyframes[self.first :]

    @property
    def newest(self) -> Keyframe:
        """The newest keyframe. Raises IndexError before the first."""
        return self._keyframes[-1]

    def begin_with(self, keyframes: Iterable[Keyframe], floors: Sequence[int], pieces: Sequence[int]) -> None:
        """Begin with the keyframes of a map on their floors; its `pieces` begin with these, the drive is another."""
        for keyframe, self.floor in zip(keyframes, floors, strict=True):
            self.append(keyframe)
        self.floor = 0
        self.first, self.joined = len(self), False
        self._pieces += [*pieces, self.first]

    def append(self, keyframe: Keyframe) -> None:
        """Add the next keyframe."""
        if len(self) == len(self._paths):
            self._paths = np.resize(self._paths, 2 * len(self._paths))
            self._has_scan = np.resize(self._has_scan, len(self._paths))
            self._floors = np.resize(self._floors, len(self._paths))
        self._paths[len(self)] = keyframe.point.path_m + self._unknown_m
        self._has_scan[len(self)] = keyframe.scan is not None
        self._floors[len(self)] = self.floor
        self._keyframes.append(keyframe)

    def join(self, keyframe: int) -> None:
        """The drive is found near this keyframe of the map, on its floor.

        What it has seen of a floor before it took an elevator is another floor: which one of the map's is not known.
        """
        self.joined = True
        own = self.floors[self.first :]
        here = own == self.floor
        own[~here & (own == 0)] = self.floors.max() + 1
        self.floor = int(self.floors[keyframe])
        own[here] = self.floor

    def change_floor(self, first: int, floor: int) -> None:
        """The keyframes from number `first` on are on another floor; no closure relates them to those before."""
        self._floors[first : len(self)] = self.floor = floor

    def begin_piece(self, path_m: float) -> None:
        """The robot was moved by an unknown way to the next keyframe, which counts as `path_m` more of path."""
        self._pieces.append(len(self))
        self._unknown_m += path_m

    @property
    def moved_to(self) -> list[int]:
        """The keyframes that begin a piece, but for the very first."""
        return self._pieces[1:]

    def begins_piece(self, number: int) -> bool:
        """Whether keyframe `number` begins a piece, so that its scan is compared with none of before."""
        return number in self._pieces

    def piece(self, number: int) -> tuple[int, int]:
        """First and last (excluded) of the keyframes around `number` whose relative poses are known."""
        following = bisect_right(self._pieces, number)
        last = self._pieces[following] if following < len(self._pieces) else len(self)
        return self._pieces[following - 1], last

    def shift(self, shift_ns: int, trajectories: Trajectories) -> dict[int, int]:
        """Move the drive's keyframes with scans to where it was `shift_ns` later; returns the stamps of those that did.

        One that would pass its neighbour, which has no scan or would leave the known path, goes half way to it.
        """
        moved, own = {}, range(self.first, len(self))
        ahead = 1 if shift_ns > 0 else -1
        for k in own[::-ahead]:
            stamp_ns = self[k].point.stamp_ns
            to_ns = stamp_ns + shift_ns
            if k + ahead in own and ahead * (self[k + ahead].point.stamp_ns - to_ns) <= 0:
                to_ns = (stamp_ns + self[k + ahead].point.stamp_ns) // 2
            if self[k].scan and to_ns != stamp_ns and (point := trajectories.at(to_ns)):
                self._move(k, point)
                moved[k] = to_ns
        return moved

    def _move(self, number: int, to: PathPoint) -> None:
        """Move a keyframe to another place on the path; what counts along that is not known there, and stays."""
        point = self[number].point
        moved = point._replace(stamp_ns=to.stamp_ns, T_path_base=to.T_path_base, path_m=to.path_m)
        self._keyframes[number] = replace(self[number], point=moved)
        self._paths[number] += to.path_m - point.path_m

    def forget_oldest(self, count: int) -> None:
        """Drop the oldest `count` keyframes, fewer than there are; the others are numbered from 0 again."""
        self._keyframes = self._keyframes[count:]
        self._paths, self._has_scan = self._paths[count:], self._has_scan[count:]
        self._pieces = [0, *(piece - count for piece in self._pieces if piece > count)]

    def forget_scans(self) -> None:
        """Remove the scans of the drive's own keyframes."""
        self._keyframes[self.first :] = [Keyframe(keyframe.point, None) for keyframe in self.own]
        self._has_scan[self.first :] = False

    def before(self, stamp_ns: int) -> int:
        """The drive's newest keyframe that is no later than `stamp_ns`, which is recent; its first where none is."""
        number = len(self) - 1
        while number > self.first and self[number].point.stamp_ns > stamp_ns:
            number -= 1
        return number

    @property
    def paths_m(self) -> Floats:
        """(n,) the path up to each keyframe, m: driven, and what `begin_piece` adds to it."""
        return self._paths[: len(self)]

    @property
    def has_scan(self) -> NDArray[np.bool_]:
        """(n,) whether each keyframe holds a scan."""
        return self._has_scan[: len(self)]

    @property
    def floors(self) -> NDArray[np.int64]:
        """(n,) the floor of each keyframe."""
        return self._floors[: len(self)]

    @property
    def reachable_scans(self) -> NDArray[np.bool_]:
        """(n,) whether each keyframe holds a scan, is on the present floor, and it is known where that is."""
        reachable: NDArray[np.bool_] = self.has_scan & (self.floors == self.floor)
        if not self.joined:
            reachable[: self.first] = False
        return reachable

    def may_close(self, a: int, b: int) -> bool:
        """Whether keyframe `a` is on the floor of keyframe b of the drive, and it is known where it is from there."""
        return bool(self.floors[a] == self.floors[b]) and (self.joined or a >= self.first)

    def scans_around(self, first: int, last: int, origin: Floats, poses: Floats) -> tuple[list[ScanPoints], Floats]:
        """Scans of keyframes first..last (excluded), and their (n, 3) poses in the frame at `origin`."""
        numbers = [k for k in range(max(first, 0), min(last, len(self))) if self[k].scan is not None]
        scans = [scan for k in numbers if (scan := self[k].scan) is not None]
        placed = between_all(origin, poses[numbers]) if numbers else np.empty((0, 3))
        return scans, placed


def keyframe_due(motion: WheelMotion, config: OdometryConfig, factor: float = 1.0) -> bool:
    """Whether a new keyframe is due after `motion` since the last one; `factor` multiplies the limits."""
    if motion.discontinuities or motion.open_m2 >= config.keyframe_distance_m**2:
        return True
    turned = abs(motion.pose.theta)
    if motion.path_m >= factor * config.keyframe_distance_m or turned >= factor * config.keyframe_turn_rad:
        return True
    moved = motion.path_m > config.keyframe_still_m or turned > config.keyframe_still_rad
    return moved and motion.seconds >= factor * config.keyframe_seconds
