"""What leads in place of odometry messages that do not come: the odometry in /tf, or the laser."""

from collections.abc import Iterator

from wayfi.frontends.events import Event, Warned
from wayfi.frontends.intake.laser_lead import LaserLead
from wayfi.frontends.intake.scan_intake import ScanIntake
from wayfi.frontends.lidar.lidar_config import LidarConfig
from wayfi.frontends.lidar.scan_odometry import Led
from wayfi.frontends.measurements import MovingTransforms, Sweep
from wayfi.frontends.odometry.accepted_odometry import AcceptedOdometry
from wayfi.frontends.odometry.transform_odometry import TransformOdometry

LATE_MESSAGES = 5  # times longer is waited for messages that came before: those of a busy network come later than /tf

TRANSFORMS_LEAD = "no odometry messages: it is taken from /tf"
WHEELS_LEAD = "odometry has come: the wheels lead from here on"


class StandIns:
    """Begins and ends the leads of the laser and of /tf, whose poses wait in `transforms`; one leads at most."""

    def __init__(self, config: LidarConfig, scans: ScanIntake, odometry: AcceptedOdometry, lead_after_ns: int) -> None:
        self._config, self._scans, self._odometry = config, scans, odometry
        self._lead_after_ns = lead_after_ns
        self.transforms = TransformOdometry()
        self.transforms_lead = False
        self._laser: LaserLead | None = None

    @property
    def laser_leads(self) -> bool:
        """Whether the laser leads."""
        return self._laser is not None

    @property
    def lead(self) -> bool:
        """Whether either leads."""
        return self.laser_leads or self.transforms_lead

    def follow(self, stamp_ns: int, sweep: Sweep) -> bool:
        """Whether the laser that leads is the one that a sweep is from."""
        return self._laser is not None and self._laser.follows(stamp_ns, sweep)

    def add_transforms(self, m: MovingTransforms) -> bool:
        """Let the poses in /tf wait for messages of odometry; returns whether they lead now, or are to begin to."""
        self.transforms.add(m)
        messages_led = self._odometry.path.latest is not None and not self.lead
        patience_ns = (LATE_MESSAGES if messages_led else 1) * self._lead_after_ns
        return self.transforms_lead or self.transforms.waited_ns > patience_ns

    def match(self, stamp_ns: int, sweep: Sweep) -> Led:
        """Match the next sweep with the laser that leads; its pose is that at `stamp_ns`, the sweep's."""
        assert self._laser is not None
        return self._laser.match(stamp_ns, sweep)

    def begin_laser(self, stamp_ns: int) -> Iterator[Event]:
        """Let the laser lead, if it does not yet."""
        if self.laser_leads:
            return
        second, last_ns = self._odometry.path.newest_second(), self._last_ns()
        self._laser, self.transforms_lead = LaserLead(self._config, self._scans, last_ns, second), False
        self._odometry.begin_stand_in()
        yield Warned(stamp_ns, "no odometry: the laser leads")

    def begin_laser_anew(self) -> None:
        """Join the next sweep without motion, if the laser leads: what it has seen so far lies elsewhere."""
        if self.laser_leads:
            self._laser = LaserLead(self._config, self._scans, self._last_ns())
            self._odometry.path.restart()

    def _last_ns(self) -> int | None:
        latest = self._odometry.path.latest
        return latest.stamp_ns if latest else None

    def begin_transforms(self, stamp_ns: int) -> Iterator[Event]:
        """Let /tf lead, if it does not yet."""
        if self.transforms_lead:
            return
        self._laser, self.transforms_lead = None, True
        self._odometry.begin_stand_in()
        yield Warned(stamp_ns, f"{TRANSFORMS_LEAD} ({self.transforms.named})")

    def end(self, stamp_ns: int) -> Iterator[Event]:
        """Odometry has come, which ended the lead."""
        other = "/tf" if self.transforms_lead else "the laser"
        self._laser, self.transforms_lead = None, False
        yield Warned(stamp_ns, f"{WHEELS_LEAD}, not {other}")
