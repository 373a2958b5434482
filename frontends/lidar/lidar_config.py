"""The settings of the laser: scans, the local submap, scan matching, and the height band of a 3D LiDAR."""

from dataclasses import dataclass, field

from wayfi.backend.options import option
from wayfi.frontends.lidar.correlative import CorrelativeConfig
from wayfi.frontends.lidar.icp import IcpConfig


@dataclass(frozen=True)
class TrustConfig:
    """How the wheels' noise follows what scan matching finds wrong with them."""

    initial: float = option(4.0, "1", "twice the configured sigmas: trust in wheels is earned")
    memory: float = option(0.9, "", "of the last value: it follows in about ten keyframes")
    most: float = option(200.0, "1", "one slip is not to switch the wheels off")
    search_above: float = option(1.3, "1", "wheels worse than configured: search the window at every keyframe")


@dataclass(frozen=True)
class CloudConfig:
    """The height band of a 3D LiDAR, and its matching."""

    low_m: float = option(0.2, "m", "above the floor and what a robot tips and nods; heights are those of base_link")
    high_m: float = option(1.8, "m", "below ceilings and lamps")
    body_m: float = option(0.4, "m", "from the sensor: nearer is the robot itself")
    bearings: int = option(900, "", "of the scan cut from a cloud: one turn in steps of 0.4 degrees, as spun at 10 Hz")
    voxel_m: float = option(0.5, "m", "KISS-ICP's: a third of the time of 0.25 at the same drift")
    kernel_m: float = option(0.3, "m", "what wheels leave open between keyframes; the gate is three times it")
    iterations: int = option(30, "", "of KISS-ICP; it settles to 2 mm in 5 to 15")
    acceleration_m_s2: float = option(1.0, "m/s^2", "without wheels: what a robot indoors brakes with")
    acceleration_rad_s2: float = option(3.0, "rad/s^2", "without wheels: as it starts to turn")
    sigma_floor_m: float = option(0.002, "m", "errors of mount and time that all points of a cloud share")
    sigma_floor_rad: float = option(0.0005, "rad", "as above; what the cloud's own points leave is added to it")


@dataclass(frozen=True)
class LidarConfig:
    """Scans, the local submap, and when scan matching is believed."""

    enabled: bool = option(True, "", "false runs on wheels and WiFi alone")
    max_range_m: float = option(25.0, "m", "beyond it beams are too far apart to find walls again")
    thinning_m: float = option(0.06, "m", "of wall between kept points: half the time of ICP; small rooms keep enough")
    normal_radius_m: float = option(0.2, "m", "neighbours that make a wall")
    submap_keyframes: int = option(15, "", "8 m of path: long enough to average noise, short enough not to bend")
    min_points: int = option(30, "", "fewer do not fix a pose")
    min_inlier_ratio: float = option(0.5, "", "the paper: matching points at least half of the points")
    search_below: float = option(0.75, "", "under this inlier ratio the guess may be wrong: search the window first")
    degenerate_below: float = option(0.01, "", "0.002 was measured in a bare corridor, 0.4 in a hall")
    cell_m: float = option(0.5, "m", "of the index that finds nearest points; the widest gate of ICP")
    sigma_floor_m: float = option(0.004, "m", "errors of range, mount and time that all points of a scan share")
    sigma_floor_rad: float = option(0.0015, "rad", "as above")
    silent_m: float = option(2.0, "m", "path without a scan after which keyframes are made without one")
    mount: list[float] = option([], "x m, y m, theta rad", "T_base_link_laser; empty: /tf_static gives it")
    trust: TrustConfig = field(default_factory=TrustConfig)
    icp: IcpConfig = field(default_factory=IcpConfig)
    correlative: CorrelativeConfig = field(default_factory=CorrelativeConfig)
    cloud: CloudConfig = field(default_factory=CloudConfig)
