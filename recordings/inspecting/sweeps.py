"""The geometry of lasers, and how much of what they send returns."""

import math
from array import array
from collections import Counter
from dataclasses import dataclass

import numpy as np

from wayfi.frontends.intake.cloud_intake import CloudIntake
from wayfi.frontends.intake.mounts import Mounts
from wayfi.frontends.lasers.bearings import bearings_of
from wayfi.frontends.lidar.lidar_config import LidarConfig
from wayfi.frontends.measurements import LaserScan, PointCloud

MOST_SHAPES = 20  # of scans, to bound memory: a driver that never sends two alike says nothing
CLOUDS = 20  # that are looked into: they are large, and alike
EVERY = 50  # the sample of clouds is spread over the drive


@dataclass(frozen=True, slots=True)
class LaserInspection:
    """The most frequent geometry of one stream's scans, and the number of scans from each frame.

    `returns` is the median number of beams with a range within the limits; `sweep_s` is the time from the first beam to
    the last (0: not said). `fault` is what the pipeline finds wrong with the bearings, empty where they are sound.
    """

    frames: dict[str, int]
    beams: int
    view_deg: float
    step_deg: float
    range_min_m: float
    range_max_m: float | None
    sweep_s: float
    returns: float
    fault: str


@dataclass(frozen=True, slots=True)
class CloudInspection:
    """Points of a cloud (median), heights above base_link (5th and 95th percentile, m), and the share in the band."""

    frames: dict[str, int]
    points: float
    heights_m: tuple[float, float] | None
    in_band: float | None


class Scans:
    """Gathers the scans of one stream."""

    def __init__(self) -> None:
        self._frames: Counter[str] = Counter()
        self._shapes: Counter[tuple[int, float, float, float, float, float]] = Counter()
        self._examples: dict[tuple[int, float, float, float, float, float], LaserScan] = {}
        self._returns = array("l")

    def add(self, scan: LaserScan) -> None:
        """Add a scan."""
        self._frames[scan.frame_id] += 1
        shape = (
            *(len(scan.ranges), scan.angle_min, scan.angle_increment),
            *(scan.range_min_m, scan.range_max_m, scan.time_increment_s),
        )
        if shape in self._shapes or len(self._shapes) < MOST_SHAPES:
            self._shapes[shape] += 1
            self._examples.setdefault(shape, scan)
        ranges = scan.ranges
        with np.errstate(invalid="ignore"):
            seen = (ranges >= scan.range_min_m) & (ranges <= scan.range_max_m) & np.isfinite(ranges)
        self._returns.append(int(np.count_nonzero(seen)))

    def inspection(self) -> LaserInspection | None:
        """What the scans so far say; None without any."""
        if not self._shapes:
            return None
        (shape, _), *_ = self._shapes.most_common(1)
        beams, _, _, range_min_m, range_max_m, increment_s = shape
        bearings = bearings_of(self._examples[shape])
        step_deg = math.degrees(bearings.step or 0.0)
        return LaserInspection(
            frames=dict(self._frames.most_common()),
            beams=beams,
            view_deg=abs(step_deg) * max(beams - 1, 0),
            step_deg=step_deg,
            range_min_m=_finite(range_min_m) or 0.0,
            range_max_m=_finite(range_max_m),
            sweep_s=(_finite(increment_s) or 0.0) * max(beams - 1, 0),
            returns=float(np.median(self._returns)),
            fault=bearings.fault,
        )


class Clouds:
    """Gathers the clouds of one stream; a sample of them is kept until their mounts are known."""

    def __init__(self) -> None:
        self._frames: Counter[str] = Counter()
        self._sizes = array("l")
        self._sample: list[PointCloud] = []

    def add(self, cloud: PointCloud) -> None:
        """Add a cloud."""
        self._frames[cloud.frame_id] += 1
        if len(self._sizes) % EVERY == 0 and len(self._sample) < CLOUDS:
            self._sample.append(cloud)
        self._sizes.append(len(cloud.points))

    def inspection(self, mounts: Mounts, config: LidarConfig) -> CloudInspection | None:
        """What the clouds so far hold, mounted by `mounts`; None without any."""
        if not self._sizes:
            return None
        intake = CloudIntake(config, mounts)
        heights, in_band = [], 0
        for cloud in self._sample:
            mount = intake.mount(cloud.frame_id)
            points = cloud.points[np.isfinite(cloud.points).all(axis=1)].astype(np.float64)
            heights.append(points @ mount.rotation[2] + mount.translation[2])
            in_band += len(intake.band(cloud)[0])
        all_heights = np.concatenate(heights)
        low, high = np.percentile(all_heights, [5, 95]).tolist() if len(all_heights) else (0.0, 0.0)
        return CloudInspection(
            frames=dict(self._frames.most_common()),
            points=float(np.median(self._sizes)),
            heights_m=(low, high) if len(all_heights) else None,
            in_band=in_band / len(all_heights) if len(all_heights) else None,
        )


def _finite(number: float) -> float | None:
    return number if math.isfinite(number) else None
