"""What follows for the scans so far from what is learnt of the laser: its stamps, and where it is mounted."""

from collections.abc import Iterator

from wayfi.frontends.events import Event, Warned
from wayfi.frontends.intake.scan_intake import ScanIntake
from wayfi.frontends.lidar.lidar_config import LidarConfig
from wayfi.frontends.modes.estimation_core import EstimationCore
from wayfi.frontends.odometry.driven_path import DrivenPath
from wayfi.frontends.odometry.trajectories import Trajectories


class ScanCorrections:
    """Moves or forgets the scans of `core`, and corrects those that come into `scans`."""

    def __init__(self, config: LidarConfig, scans: ScanIntake, core: EstimationCore) -> None:
        self._config, self._scans, self._core = config, scans, core

    def correct_stamps(self, stamp_ns: int, path: DrivenPath, trajectories: Trajectories) -> Iterator[Event]:
        """Correct the laser's stamps where its clock is not the odometry's, or its driver stamps late."""
        offset_s = self._core.laser_offset_s(path)
        if offset_s is None:
            return
        self._scans.shift_stamps(offset_s)
        late = f"{abs(offset_s):.2f} s {'early' if offset_s > 0 else 'late'}"
        if abs(offset_s) <= self._config.clock.latency.max_s:
            yield Warned(stamp_ns, f"laser: its driver stamps its scans {late}; corrected")
            yield from self._core.shift_scans(offset_s, trajectories)
            return
        text = f"its clock is {abs(offset_s):.2f} s {'behind' if offset_s > 0 else 'ahead of'} the odometry's"
        yield Warned(stamp_ns, f"laser: {text}; its stamps are corrected from here on, set its clock", "laser.clock")
        yield from self._core.forget_scans(f"of before the laser's stamps were corrected: {text}")

    def forget_misplaced(self, stamp_ns: int) -> Iterator[Event]:
        """Forget the scans so far where they were placed with another mount than is known now."""
        changes = self._scans.mounts.changes()
        if changes:
            yield from (Warned(stamp_ns, f"{text}; the scans before are forgotten") for text in changes)
            yield from self._core.forget_scans(f"of before {changes[0]}")
