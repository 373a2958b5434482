"""The sections of the configuration: the estimation's settings and the program's, each with unit and reason."""

from dataclasses import dataclass, field
from typing import Annotated, Literal

from pydantic import Field

from wayfi.backend.options import option
from wayfi.frontends.measurements import Sensor
from wayfi.frontends.slam_config import SlamConfig
from wayfi.recordings.rerun.config import RerunConfig


@dataclass(frozen=True)
class SecurityConfig:
    """Who may connect, and as whom. Files, so that no secret is saved with a run; empty is off."""

    user: str = option("", "", "the name that is shown to those this program connects to")
    password_file: str = option("", "path", "the user's password and nothing else; not open to every user")
    users_file: str = option("", "path", "user:password lines: who is admitted; with a user and no such file, nobody")
    root_ca: str = option("", "path", "PEM: who must have signed the certificate of the other side, on tls/ endpoints")
    certificate: str = option("", "path", "PEM: this machine's own, shown both ways; whoever connects needs one")
    key: str = option("", "path", "PEM: the certificate's private key; not open to every user")
    access_control_file: str = option("", "path", "a Zenoh configuration, of it access_control: who may do what")


@dataclass(frozen=True)
class ZenohConfig:
    """How the daemon meets the network."""

    mode: str = option("peer", "peer|client|router", "a peer needs no router; several programs connect to it")
    listen: list[str] = option(["tcp/127.0.0.1:7447"], "endpoints", "loopback: nothing listens beyond unless told to")
    connect: list[str] = option([], "endpoints", "a router or peers to connect to; retried for ever")
    prefix: str = option("", "", "in front of every key; one for each robot of a fleet; a namespace in ROS 2")
    ros: Literal["none", "bridge", "rmw"] = option(
        "none", "none|bridge|rmw", "adds /tf, /map and the pose for ROS 2 behind zenoh-bridge-ros2dds or rmw_zenoh"
    )
    ros_domain: Annotated[int, Field(ge=0, le=232)] = option(0, "", "rmw: ROS_DOMAIN_ID of those who are to see them")
    odom_queue: int = option(6000, "messages", "60 s at 100 Hz: the pose needs every one, however late")
    scan_queue: int = option(20, "messages", "half a second at 40 Hz: behind a slow step the latest scans matter")
    security: SecurityConfig = field(default_factory=SecurityConfig)


@dataclass(frozen=True)
class RecordingConfig:
    """Topics, and the daemon's directory."""

    directory: str = option("wayfi_runs", "path", "one folder a run below the working directory")
    part_mb: float = option(256.0, "MiB", "a part of the black box ends at this size, some hours of a planar laser")
    part_minutes: float = option(60.0, "min", "and at this age")
    budget_mb: float = option(20_000.0, "MiB", "of all runs together; beyond it the oldest files are deleted")
    keep_free_mb: float = option(100.0, "MiB", "what the disk keeps for others: below it nothing is recorded")
    odom: str = option("/odom", "topic", "REP 105's usual name")
    scan: str = option("/scan", "topic", "as above")
    points: str = option("/points", "topic", "as above")
    wifi: str = option("/wifi", "topic", "wifi_msgs has no usual name")
    tf_static: str = option("/tf_static", "topic", "tf2's name")

    @property
    def topics(self) -> dict[Sensor, str]:
        """The topic of each sensor."""
        return {sensor: str(getattr(self, sensor.value)) for sensor in Sensor}


@dataclass(frozen=True)
class Config(SlamConfig):
    """Everything that can be set, by section: the estimation's settings, and the program's."""

    rerun: RerunConfig = field(default_factory=RerunConfig)
    zenoh: ZenohConfig = field(default_factory=ZenohConfig)
    recording: RecordingConfig = field(default_factory=RecordingConfig)
