"""Notices, in a map of several floors, that the robot may be in an elevator: its floor is not known until it is out."""

from wayfi.frontends.floors.floor_config import FloorConfig
from wayfi.frontends.floors.floor_watch import FloorWatch, is_cabin
from wayfi.frontends.scan_points import ScanPoints
from wayfi.frontends.wifi.readings import Readings


class ElevatorWatch:
    """Watches for elevators; in a map of one floor there are none."""

    def __init__(self, floors: int, config: FloorConfig, sigma_db: float) -> None:
        self._config = config
        self._watch = FloorWatch(config, sigma_db) if floors > 1 else None
        self._heard = False

    @property
    def doubtful(self) -> bool:
        """Whether it is not known which floor the robot is on."""
        return self._watch is not None and self._watch.doubtful

    def see(self, scan: ScanPoints, path_m: float, is_found: bool) -> None:
        """Take note of a scan that was taken while the wheels stood, `path_m` (m) along the path.

        Where no pose is claimed, and where there is no WiFi that could change, a cabin alone is enough for a doubt.
        """
        if self._watch is None:
            return
        self._watch.see(scan, path_m)
        if is_cabin(scan, self._config) and not (is_found and self._heard):
            self._watch.leave(path_m)

    def drive(self, path_m: float) -> None:
        """The path has come to `path_m` (m): out of the cabin, where there is no WiFi to wait for."""
        if self._watch is None:
            return
        self._watch.drive(path_m)
        left_m = self._watch.left_m
        if not self._heard and left_m is not None and path_m - left_m >= self._config.leaving_m:
            self._watch.settle()

    def hear(self, receiver: str, path_m: float, readings: Readings) -> None:
        """Take note of a WiFi scan; the first that was taken out of the cabin ends a doubt."""
        self._heard = True
        if self._watch is not None and self._watch.hear(receiver, path_m, readings):
            self._watch.settle()
