"""The settings of the laser: scans, the local submap, scan matching, the laser's faults, and 3D LiDARs."""

from dataclasses import dataclass, field

from wayfi.backend.options import option
from wayfi.frontends.axes.walls_config import WallsConfig
from wayfi.frontends.lidar.correlative import CorrelativeConfig
from wayfi.frontends.lidar.doubt import DoubtConfig
from wayfi.frontends.lidar.icp import IcpConfig
from wayfi.frontends.lidar.visibility import VisibilityConfig


@dataclass(frozen=True)
class LineConfig:
    """Which neighbouring beams make a line, whose normal a point gets."""

    corner_m: float = option(0.03, "m", "sigma across a line: thicker than a range's noise, it may be two walls")
    shadow_m: float = option(0.1, "m", "a longer gap to the next beam may lead behind an edge")
    shadow_rad: float = option(0.1, "rad", "such a gap does, if it is this nearly parallel to the ray")


@dataclass(frozen=True)
class WheelTrustConfig:
    """How the wheels' covariance is scaled by what scan matching finds wrong with them."""

    initial: float = option(4.0, "1", "twice the configured sigmas, until scan matching has confirmed the wheels")
    memory: float = option(0.9, "", "of the last value: it follows in about ten keyframes")
    most: float = option(200.0, "1", "one slip is not to switch the wheels off")
    search_above: float = option(1.3, "1", "wheels worse than configured: search the window at every keyframe")


@dataclass(frozen=True)
class SearchConfig:
    """The window that is searched where scan matching from the wheels' guess fits badly."""

    chi2: float = option(9.0, "1", "97 % of the wheels' errors at 3 degrees of freedom, if their covariance is right")
    min_window_m: float = option(0.3, "m", "to each side: wheels that slip err by more than their covariance")
    min_window_rad: float = option(0.3, "rad", "as above")
    max_window_m: float = option(1.0, "m", "to each side: twice the keyframes' distance; bounds the cost")
    max_window_rad: float = option(1.0, "rad", "as above")
    min_gain: float = option(0.05, "1", "of inlier ratio, and of that in sight: 10 of 200 points, not chance")
    nearly_open: float = option(0.2, "1", "of the information across walls: noisy aisles feigned 0.02 to 0.14")


@dataclass(frozen=True)
class RelocationConfig:
    """The window of the wide search, and when what it finds is the one place that it can be."""

    window_m: float = option(4.0, "m", "to each side; with all headings 14 million look-ups, some 20 ms")
    window_rad: float = option(3.1416, "rad", "as above: a turn that the odometry missed may be any")
    points: int = option(100, "", "half of the usual search's: the cost again")
    max_coarse_cells: int = option(3000, "", "coarse cells opened: five times the usual search's, of 50 times as many")
    angle_step: float = option(0.02, "rad", "0.2 m at 10 m, which the field's blur covers")
    min_inlier_ratio: float = option(0.85, "", "with a free choice of the pose a mirrored hall fitted to 0.82")
    max_second_peak: float = option(0.85, "", "of the best score: nearer than this the place is ambiguous")
    max_seen_through: float = option(0.15, "", "of the walls in view; sound matches had 0.01 to 0.15")
    unseen: float = option(
        0.7, "", "likelihood of a point where the map saw nothing: somewhat less than that of one that fits"
    )


@dataclass(frozen=True)
class LatencyConfig:
    """When the laser's driver is found to stamp its scans late."""

    max_s: float = option(0.35, "s", "either way; real drivers are 0.1 to 0.2 late, and more is another clock")
    min_s: float = option(0.04, "s", "less is 2 cm at 0.5 m/s, and not worth moving the scans")
    min_turns: int = option(20, "turns", "as many as a robot makes in some minutes")
    max_turns: int = option(200, "turns", "the last ones: bounds the cost")
    every_turns: int = option(10, "turns", "between two estimates: as above")
    min_gain: float = option(15.0, "nats", "of the likelihood; sound recordings were seen to have 6")


@dataclass(frozen=True)
class LaserClockConfig:
    """When the laser's stamps are found to be from another clock than the odometry's."""

    max_offset_s: float = option(3.0, "s", "either way: scans more than 2 s ahead of the odometry are not used at all")
    step_s: float = option(0.1, "s", "between offsets that are compared; a parabola through three refines the best")
    min_turn_rad: float = option(0.1, "rad", "between keyframes: a smaller turn is as much noise as turn")
    max_error_rad: float = option(0.3, "rad", "a failed scan match counts no more than this")
    min_turns: int = option(8, "turns", "seven were seen to agree on 0.94 s by chance")
    min_agreement: float = option(0.8, "", "of the turns must fit better with the offset: no few large ones decide")
    max_turns: int = option(40, "turns", "the last ones: older turns may be from before the clock was set")
    min_gain: float = option(6.0, "1", "factor on the mean squared error; sound recordings were seen to have 2.7")
    good_error_rad: float = option(0.05, "rad", "root mean square without an offset: below it none is looked for")
    latency: LatencyConfig = field(default_factory=LatencyConfig)


@dataclass(frozen=True)
class LaserWatchConfig:
    """Which scans are faulty, and how many faulty ones make a complaint."""

    cover_m: float = option(0.15, "m", "nearer is something on the sensor")
    blocked_share: float = option(0.8, "", "of all beams; a fifth was seen to end at a robot's own parts")
    min_return_share: float = option(0.2, "", "of all beams; sound lasers in bare corridors were seen to have 0.38")
    late_s: float = option(1.5, "s", "behind the odometry of the same stamp; sound drivers take a tenth of it")
    silent_s: float = option(30.0, "s", "without a scan; sound recordings have scans 14 s apart")
    window: int = option(20, "scans", "that a complaint rests on: 2 s at 10 Hz")
    faulty: int = option(16, "scans", "of the window: some drivers cut a sweep into scans, most of them empty")
    few_window: int = option(5, "keyframes", "that the complaint of too few points to match rests on: 2.5 m of path")
    few_keyframes: int = option(4, "keyframes", "of these: a robot close to a wall or in the open is soon past it")
    limit_share: float = option(0.998, "", "of range_max: drivers report a little less where nothing returns")
    no_return_share: float = option(0.05, "", "of all beams at the largest range; walls were seen to give 0.022")
    no_return_scans: int = option(5, "scans", "with the same largest range, until it is reported: not one wall's")


@dataclass(frozen=True)
class CloudFitConfig:
    """The point-to-line fit of a cloud that follows KISS-ICP."""

    gate_m: float = option(0.5, "m", "KISS-ICP's voxel; also the side of the cells that find nearest points")
    wall_radius_m: float = option(0.35, "m", "neighbours that make a wall: three times the 0.11 m between map points")
    kernel_m: float = option(0.1, "m", "Cauchy's scale: what is further from its wall is mostly something else")
    inlier_m: float = option(0.15, "m", "a range's noise, and where there is no wall the spacing of the map's points")
    noise_m: float = option(0.01, "m", "of a range: residuals that happen to be smaller are luck")
    cluster_cells: int = option(2, "cells", "side of a square, 1 m of wall, whose points are assumed to err together")
    iterations: int = option(6, "", "from KISS-ICP's result it settles in 2 to 5")


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
    settled: float = option(0.002, "m and rad", "a step of KISS-ICP: near enough for the fit that follows")
    acceleration_m_s2: float = option(1.0, "m/s^2", "without wheels: what a robot indoors brakes with")
    acceleration_rad_s2: float = option(3.0, "rad/s^2", "without wheels: as it starts to turn")
    shortest_step_s: float = option(
        0.15, "s", "without wheels: of 10 clouds a second every other is matched; half the work, and as good a map"
    )
    longest_gap_s: float = option(1.0, "s", "without wheels: for so long a motion is assumed to go on as it was")
    sigma_floor_m: float = option(0.002, "m", "errors of mount and time that all points of a cloud share")
    sigma_floor_rad: float = option(0.0005, "rad", "as above; what the cloud's own points leave is added to it")
    fit: CloudFitConfig = field(default_factory=CloudFitConfig)


@dataclass(frozen=True)
class LeadConfig:
    """How planar scans lead where no odometry comes: at constant velocity, and what walls leave open."""

    acceleration_m_s2: float = option(1.0, "m/s^2", "what a robot indoors brakes with")
    acceleration_rad_s2: float = option(3.0, "rad/s^2", "as it starts to turn")
    longest_gap_s: float = option(1.0, "s", "between scans: for so long a motion is assumed to go on as it was")
    open_m_s: float = option(0.5, "m/s", "by which the speed may err along walls: robots start and stop there unseen")


@dataclass(frozen=True)
class LidarConfig:
    """Scans, the local submap, and when a scan match becomes a factor."""

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
    sigma_floor_m: float = option(0.002, "m", "errors of range, mount and time that all points of a scan share")
    sigma_floor_rad: float = option(0.0005, "rad", "as above; at 0.0015 the wheels bent a long hall by 1 mrad a lap")
    silent_m: float = option(2.0, "m", "path without a scan after which keyframes are made without one")
    lead_voxel_m: float = option(
        0.5, "m", "KISS-ICP's, without wheels: 2 to 3 cm over 135 m in a hall; 1.0 drifts, 0.25 is slower and no better"
    )
    mount: list[float] = option([], "x m, y m, theta rad", "T_base_link_laser; empty: /tf_static gives it")
    lead: LeadConfig = field(default_factory=LeadConfig)
    lines: LineConfig = field(default_factory=LineConfig)
    trust: WheelTrustConfig = field(default_factory=WheelTrustConfig)
    icp: IcpConfig = field(default_factory=IcpConfig)
    search: SearchConfig = field(default_factory=SearchConfig)
    relocation: RelocationConfig = field(default_factory=RelocationConfig)
    visibility: VisibilityConfig = field(default_factory=VisibilityConfig)
    doubt: DoubtConfig = field(default_factory=DoubtConfig)
    correlative: CorrelativeConfig = field(default_factory=CorrelativeConfig)
    clock: LaserClockConfig = field(default_factory=LaserClockConfig)
    watch: LaserWatchConfig = field(default_factory=LaserWatchConfig)
    cloud: CloudConfig = field(default_factory=CloudConfig)
    walls: WallsConfig = field(default_factory=WallsConfig)
