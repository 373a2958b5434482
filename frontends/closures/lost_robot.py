"""The search for a robot that was moved: scans since then are looked for all over the map of before.

A good fit alone confirms nothing, for buildings repeat. One scan is compared with every place of the map; if it fits
one of them alone, a second scan, taken some path later, has to be found where the first one puts it.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.graph.health import position_sigma
from wayfi.backend.pose2 import Floats, Pose2, between_all, diagonal_covariance
from wayfi.frontends.closures.closure_config import ClosureConfig
from wayfi.frontends.keyframes import Keyframes
from wayfi.frontends.lidar.lidar_config import LidarConfig
from wayfi.frontends.lidar.relocation import Sight, WideFit, has_rival, search_widely
from wayfi.frontends.lidar.scan_matching import match_covariance, merge_submap
from wayfi.frontends.lidar.visibility import seen_through_share


@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """Keyframe b, of after the robot was moved, as its scan fits the `submap` (n, 2) m of keyframe a, of before."""

    a: int
    b: int
    fit: WideFit
    covariance: Floats
    submap: Floats

    def placed(self, keyframe: int, poses: Floats) -> Pose2:
        """Where this puts another `keyframe` that was moved along with b; `poses` (n, 3) in `map`."""
        T_map_b = Pose2.of(poses[self.a]) @ self.fit.result.T_target_scan
        return T_map_b @ Pose2.of(poses[self.b]).between(Pose2.of(poses[keyframe]))


@dataclass(frozen=True, slots=True, eq=False)
class _Sweep:
    """The comparison of keyframe b with the map: the `places` that are left, and what has fitted."""

    b: int
    places: list[int]
    fits: list[Found]


class LostRobotSearch:
    """Searches from `begin` until the robot is found, one comparison for each keyframe."""

    def __init__(self, keyframes: Keyframes, closure: ClosureConfig, lidar: LidarConfig) -> None:
        self._keyframes, self._closure, self._lidar = keyframes, closure, lidar
        self._map_end: int | None = None
        self._begun = -1
        self._sweep: _Sweep | None = None
        self._first: Found | None = None

    def begin(self, keyframe: int) -> None:
        """The robot was moved before `keyframe`; while it is lost, the map stays that of before the first move.

        The search goes on with the keyframe after it, whose own scan has just been looked for widely: one such search
        is enough for one message.
        """
        self._map_end = keyframe if self._map_end is None else self._map_end
        self._begun = keyframe
        self._sweep = self._first = None

    def closed(self, a: int, b: int) -> None:
        """A loop closure from keyframe a to b was accepted; if it leads into the map, the search ends."""
        if self._map_end is not None and a < self._map_end <= self._keyframes.piece(b)[0]:
            self._map_end = self._sweep = self._first = None

    def scans_forgotten(self) -> None:
        """Begin anew in the scans of the map that are left; the search ends where none is."""
        self._sweep = self._first = None
        if not self._keyframes.has_scan[: self._map_end].any():
            self._map_end = None

    def search(self, keyframe: int, poses: Floats) -> list[Found]:
        """Go on with the newest keyframe; returns the two that agree once the robot is found, else nothing."""
        if self._map_end is None or keyframe == self._begun or not self._has_scan(keyframe):
            return []
        if self._first is not None:
            return self._confirm(self._first, keyframe, poses, self._map_end)
        if self._sweep is None:
            self._sweep = _Sweep(keyframe, self._places(Pose2.of(poses[keyframe]), poses, self._map_end), [])
        self._compare_next(self._sweep, poses)
        return []

    def _has_scan(self, keyframe: int) -> bool:
        scan = self._keyframes[keyframe].scan
        return scan is not None and len(scan.points) >= self._lidar.min_points

    def _compare_next(self, sweep: _Sweep, poses: Floats) -> None:
        if sweep.places:
            found = self._compare(sweep.places.pop(0), sweep.b, Pose2(), poses)
            sweep.fits.extend([found] if found else [])
        if not sweep.places:
            self._first, self._sweep = self._only_one(sweep.fits, poses), None

    def _confirm(self, first: Found, keyframe: int, poses: Floats, map_end: int) -> list[Found]:
        """Compare with where `first` puts the keyframe; `first` is dropped if that fits elsewhere, or never."""
        path_m = self._keyframes.paths_m[keyframe] - self._keyframes.paths_m[first.b]
        if path_m < self._closure.lost.confirm_m:
            return []
        T_map_b = first.placed(keyframe, poses)
        a = self._places(T_map_b, poses, map_end)[0]
        second = self._compare(a, keyframe, Pose2.of(poses[a]).between(T_map_b), poses)
        if second and self._is_sure(second):
            agrees = self._agree(first, second, poses)
            self._first = None
            return [first, second] if agrees else []
        if path_m > self._closure.lost.drop_m:
            self._first = None
        return []

    def _places(self, near: Pose2, poses: Floats, map_end: int) -> list[int]:
        """Keyframes spread over the map, the nearest to a pose first."""
        left: NDArray[np.intp] = np.flatnonzero(self._keyframes.has_scan[:map_end])
        left = left[np.argsort(self._apart(near.array(), poses[left]), kind="stable")]
        places = []
        while len(left):
            places.append(int(left[0]))
            left = left[self._apart(poses[left[0]], poses[left]) > self._closure.lost.places_m]
        return places

    def _apart(self, pose: Floats, poses: Floats) -> Floats:
        """(n,) distance of poses (n, 3) from one, m; a turn counts as well, for it shows other walls."""
        T = between_all(pose, poses)
        return np.asarray(np.hypot(T[:, 0], T[:, 1]) + self._closure.turn_cost_m_per_rad * np.abs(T[:, 2]))

    def _compare(self, a: int, b: int, guess: Pose2, poses: Floats) -> Found | None:
        """The scan of b where it fits the submap of a, if it fits so well that it may be there."""
        reach, (first, last) = self._closure.submap_reach, self._keyframes.piece(a)
        scans, placed = self._keyframes.scans_around(max(a - reach, first), min(a + reach + 1, last), poses[a], poses)
        submap, scan = merge_submap(scans, placed, self._lidar.cell_m), self._keyframes[b].scan
        assert scan is not None
        if submap is None:
            return None
        fit, bounds = search_widely(scan, submap, guess, self._lidar), self._lidar.relocation
        T = fit.result.T_target_scan
        if fit.result.inlier_ratio < bounds.max_second_peak * bounds.min_inlier_ratio:
            return None
        if seen_through_share(scan, submap.points, T, self._lidar.visibility) > bounds.max_seen_through:
            return None
        if fit.alone and has_rival(scan, submap, Sight(scans, placed), T, self._lidar):
            fit = replace(fit, alone=False)
        return Found(a, b, fit, self._covariance(fit), submap.points)

    def _covariance(self, fit: WideFit) -> Floats:
        lidar, floor = self._lidar, diagonal_covariance(self._closure.sigma_floor_m, self._closure.sigma_floor_rad)
        return match_covariance(fit.result, lidar.degenerate_below, lidar.sigma_floor_m, lidar.sigma_floor_rad) + floor

    def _is_sure(self, found: Found) -> bool:
        fits = found.fit.result.inlier_ratio >= self._lidar.relocation.min_inlier_ratio
        return fits and found.fit.alone and position_sigma(found.covariance) <= self._closure.max_sigma_m

    def _only_one(self, fits: list[Found], poses: Floats) -> Found | None:
        """The best of the fits of one scan; None if it is not sure, or another one elsewhere fits about as well."""
        best = max(fits, key=lambda found: found.fit.result.inlier_ratio, default=None)
        if best is None or not self._is_sure(best):
            return None
        least = self._lidar.relocation.max_second_peak * best.fit.result.inlier_ratio
        rivals = [found for found in fits if found.fit.result.inlier_ratio >= least]
        return best if all(found.fit.alone and self._agree(best, found, poses) for found in rivals) else None

    def _agree(self, one: Found, other: Found, poses: Floats) -> bool:
        apart = one.placed(other.b, poses).between(other.placed(other.b, poses))
        return apart.distance(Pose2()) < self._closure.lost.agree_m and abs(apart.theta) < self._closure.lost.agree_rad
