"""Watches how much of what the lasers send can be used: nothing, or too little, is told with what to set."""

from collections.abc import Iterator

from wayfi.frontends.complaints import Complaints, Fault
from wayfi.frontends.events import Event
from wayfi.frontends.intake.cloud_intake import CloudIntake
from wayfi.frontends.lasers.unused import why_few_points, why_no_band, why_no_point, why_no_return
from wayfi.frontends.lidar.lidar_config import LidarConfig
from wayfi.frontends.measurements import LaserScan, PointCloud, Sweep
from wayfi.frontends.scan_points import PlacedScan

LIMITS, FEW_POINTS = "no_usable_return", "few_points"
MOST_NAMES = 32  # of lasers, to bound memory


class UseWatch:
    """Watches sweeps as they come, and those of keyframes as they are placed."""

    def __init__(self, config: LidarConfig, clouds: CloudIntake) -> None:
        self._config, self._clouds = config, clouds
        faulty, window = config.watch.faulty, config.watch.window
        kept, keyframes = config.watch.few_keyframes, config.watch.few_window
        faults = {
            LIMITS: Fault(faulty, window, "its beams can be used again"),
            FEW_POINTS: Fault(kept, keyframes, "its scans have enough points again"),
        }
        self._complaints = Complaints("{}", faults, config.watch.silent_s)
        self._names: set[str] = set()

    def add_sweep(self, stamp_ns: int, name: str, sweep: Sweep, sees: bool) -> Iterator[Event]:
        """Note whether a laser's sweep `sees` anything within the limits."""
        text, furthest_m = "", self._config.max_range_m
        if not sees:
            text = why_no_return(sweep, furthest_m) if isinstance(sweep, LaserScan) else why_no_point(sweep, furthest_m)
        yield from self._judge(stamp_ns, name, LIMITS, text)

    def judge(self, stamp_ns: int, name: str, sweep: Sweep, placed: PlacedScan | None) -> Iterator[Event]:
        """Note whether a keyframe's sweep, as `placed`, has enough points to be matched."""
        points = len(placed.points.points) if placed else 0
        text = "" if points >= self._config.min_points else self._why_few(sweep, points)
        yield from self._judge(stamp_ns, name, FEW_POINTS, text)

    def _why_few(self, sweep: Sweep, points: int) -> str:
        if not isinstance(sweep, PointCloud):
            return why_few_points(points, sweep.ranges, self._config.min_points)
        if points == 0:
            heights_m = self._clouds.heights(sweep)
            near = len(heights_m) > 0
            return why_no_band(heights_m, self._config.cloud) if near else why_no_point(sweep, self._config.max_range_m)
        return why_few_points(points, sweep.points, self._config.min_points)

    def _judge(self, stamp_ns: int, name: str, fault: str, text: str) -> Iterator[Event]:
        if name not in self._names:
            if len(self._names) >= MOST_NAMES:
                return
            self._names.add(name)
            self._complaints.heard(name)
        yield from self._complaints.judge(stamp_ns, name, fault, [bool(text)], text)
