"""What the pipeline asks of the estimation: SLAM, or localisation in a known map."""

from typing import Protocol

from wayfi.backend.graph.wheel_calibration import WheelMotion
from wayfi.frontends.calibration import Calibration
from wayfi.frontends.events import Event
from wayfi.frontends.intake.pose_intake import PlacedPose
from wayfi.frontends.maps.building_map import BuildingMap
from wayfi.frontends.modes.continued_slam import ContinuedSlam
from wayfi.frontends.modes.localization_core import LocalizationCore
from wayfi.frontends.odometry.driven_path import DrivenPath, PathPoint
from wayfi.frontends.odometry.live_pose import Anchor
from wayfi.frontends.odometry.odometry_config import calibration_prior
from wayfi.frontends.odometry.trajectories import Trajectories
from wayfi.frontends.result import DriveEstimate
from wayfi.frontends.scan_points import PlacedScan
from wayfi.frontends.slam import SlamCore
from wayfi.frontends.slam_config import SlamConfig
from wayfi.frontends.step_matcher import StepMatcher
from wayfi.frontends.timer import Timer
from wayfi.frontends.wifi.readings import PlacedWifiScan


class EstimationCore(Protocol):
    """The state of an estimation that keyframes and WiFi scans are added to."""

    @property
    def steps(self) -> StepMatcher:
        """What matches the scans of one step."""

    @property
    def keyframe_count(self) -> int:
        """How many keyframes there have been."""

    @property
    def floor(self) -> int | None:
        """The floor of the map on which the robot is; None while that is not known."""

    def motion_to(self, point: PathPoint) -> WheelMotion:
        """The wheels' motion from the newest keyframe to `point`."""

    def anchor(self) -> Anchor | None:
        """The newest keyframe as the anchor of poses since then; None while the pose is not claimed."""

    def add_keyframe(self, point: PathPoint, placed: PlacedScan | None) -> list[Event]:
        """Add a keyframe at `point`, with its scan if there is one."""

    def look(self, point: PathPoint, placed: PlacedScan) -> list[Event]:
        """Compare a scan that was taken while the wheels stood."""

    def add_wifi(self, stamp_ns: int, scan: PlacedWifiScan) -> list[Event]:
        """Add a WiFi scan at `stamp_ns`, no earlier than its own."""

    def add_pose(self, placed: PlacedPose) -> list[Event]:
        """Add a pose from outside."""

    def edit(self, closure: int, restored: bool) -> list[Event]:
        """Take an accepted closure out of the estimate, or put a vetoed one back. Raises VetoError."""

    def go_on(self, stamp_ns: int) -> list[Event]:
        """Do a slice of the work that is not tied to a measurement."""

    def laser_offset_s(self, path: DrivenPath) -> float | None:
        """What is to be added to the laser's stamps, s; None while they are not known to differ from the odometry's."""

    def shift_scans(self, seconds: float, trajectories: Trajectories) -> list[Event]:
        """Take the scans so far as taken `seconds` later."""

    def forget_scans(self, reason: str) -> list[Event]:
        """Forget all scans so far."""

    def history(self, stamp_ns: int) -> list[Event]:
        """The events with which a new log begins."""

    def made_map(self) -> BuildingMap | None:
        """The map that the drive has made so far, its grid as drawn last; None where it has made none."""

    def finish(self, trajectories: Trajectories) -> tuple[DriveEstimate, list[Event]]:
        """End the drive; returns it as estimated with everything."""


def estimation_core(
    config: SlamConfig, calibration: Calibration | None, timer: Timer, building: BuildingMap | None, extends: bool
) -> EstimationCore:
    """The estimation of a drive: SLAM, or localisation in `building`, or SLAM that `extends` it."""
    if building is not None:
        core = ContinuedSlam if extends else LocalizationCore
        return core(config, calibration or building.calibration, timer, building)
    return SlamCore(config, calibration or Calibration(calibration_prior(config.odometry), {}), timer)
