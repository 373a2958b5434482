"""Keeps the floor of the drive's keyframes."""

import numpy as np

from wayfi.backend.pose2 import Floats
from wayfi.frontends.events import Event, FloorChanged, Warned
from wayfi.frontends.floors.floor_config import FloorConfig
from wayfi.frontends.floors.floor_watch import FloorWatch
from wayfi.frontends.keyframes import Keyframes
from wayfi.frontends.scan_points import ScanPoints
from wayfi.frontends.wifi.fingerprints import WifiCandidate
from wayfi.frontends.wifi.readings import PlacedWifiScan, Readings
from wayfi.frontends.wifi.wifi_frontend import WifiFrontend


class FloorTracker:
    """Gives keyframes another floor once WiFi tells that the robot is on it."""

    def __init__(self, keyframes: Keyframes, wifi: WifiFrontend, config: FloorConfig, sigma_db: float) -> None:
        self._keyframes, self._wifi, self._config = keyframes, wifi, config
        self._watch = FloorWatch(config, sigma_db)
        self._first = 0  # keyframe that may be on another floor

    @property
    def doubtful(self) -> bool:
        """Whether it is not known which floor the robot is on: nothing is closed meanwhile."""
        return self._watch.doubtful

    def known_at(self, path_m: float) -> bool:
        """Whether it is known which floor the robot is on, now that it has driven `path_m` (m)."""
        self._watch.drive(path_m)
        return not self.doubtful

    def may_close(self, candidate: WifiCandidate) -> bool:
        """Whether both places of a candidate are on one floor, and it is known where they are from each other."""
        return not self.doubtful and self._keyframes.may_close(candidate.a.keyframe, candidate.b.keyframe)

    def look(self, scan: ScanPoints) -> None:
        """Take note of a scan that was taken while the wheels stood."""
        self._watch.see(scan, self._keyframes.newest.point.path_m)

    def hear(self, scan: PlacedWifiScan, stamp_ns: int, poses: Floats) -> list[Event]:
        """Take note of a WiFi scan; the keyframes since the cabin are on another floor if it tells so."""
        was_doubtful = self.doubtful
        tells = self._watch.hear(scan.receiver, scan.point.path_m, scan.readings)
        self._begin_doubt(was_doubtful)
        if not tells:
            return []
        keyframes, before = self._keyframes, self._keyframes.floor
        known = self._known_near(poses)
        floor = self._watch.floor_of(scan.readings, known, before, int(keyframes.floors.max()))
        if floor == before:
            return []
        if floor not in (at for at, _ in known) and self._began_in_cabin():
            return [Warned(stamp_ns, f"floor {before} is where the robot left the elevator that it was switched on in")]
        told = f"floor {floor}: WiFi has changed since the robot stood in a cabin on floor {before}"
        keyframes.change_floor(self._first, floor)
        return [Warned(stamp_ns, told), FloorChanged(stamp_ns, floor)]

    def _known_near(self, poses: Floats) -> list[tuple[int, Readings]]:
        """The fingerprints near the robot from before the cabin with their floors; a map's only once it is joined."""
        positions = poses[:, :2]
        near = np.hypot(*(positions - positions[-1]).T) < self._config.near_m
        near[: 0 if self._keyframes.joined else self._keyframes.first] = False
        heard = [f for f in self._wifi.fingerprints if near[f.keyframe] and f.keyframe < self._first]
        return [(int(self._keyframes.floors[f.keyframe]), f.readings) for f in heard]

    def _began_in_cabin(self) -> bool:
        """Whether the drive has seen nothing but the cabin before: there is no floor that the robot has left."""
        keyframes = self._keyframes
        last = max(self._first - 1, keyframes.first)
        driven_m = keyframes.paths_m[last] - keyframes.paths_m[keyframes.first]
        return bool(driven_m < self._config.leaving_m)

    def _begin_doubt(self, was_doubtful: bool) -> None:
        """Scans from here on are compared with none of before: outside of the cabin there may be other walls."""
        if self.doubtful and not was_doubtful:
            self._first = len(self._keyframes)
            self._keyframes.begin_piece(0.0)
