"""The sections of the configuration: the estimation's settings and the program's, each with unit and reason."""

from dataclasses import dataclass, field
from typing import Annotated, Literal

from pydantic import Field

from wayfi.backend.options import option
from wayfi.frontends.measurements import Sensor
from wayfi.frontends.radio.radio_config import RadioConfig
from wayfi.frontends.slam_config import SlamConfig
from wayfi.recordings.rerun.config import RerunConfig


@dataclass(frozen=True)
class SecurityConfig:
    """Authentication and access control on Zenoh. Secrets are in files, so that no run saves them; empty is off."""

    user: str = option("", "", "the name with which this program logs in where it connects")
    password_file: str = option("", "path", "the user's password and nothing else; not open to every user")
    users_file: str = option(
        "", "path", "lines of user:password that are admitted; with a user and no such file, nobody is"
    )
    root_ca: str = option(
        "", "path", "PEM: the authority that must have signed the other side's certificate, on tls/ endpoints"
    )
    certificate: str = option("", "path", "PEM: this machine's own, as client and server; every client needs one")
    key: str = option("", "path", "PEM: the certificate's private key; not open to every user")
    access_control_file: str = option("", "path", "a Zenoh configuration, whose access_control says who may do what")


@dataclass(frozen=True)
class ZenohConfig:
    """The Zenoh session of the daemon, and its input queues."""

    mode: str = option("peer", "peer|client|router", "a peer needs no router; several programs connect to it")
    listen: list[str] = option(["tcp/127.0.0.1:7447"], "endpoints", "loopback: nothing listens beyond unless told to")
    connect: list[str] = option([], "endpoints", "a router or peers to connect to; retried until they answer")
    prefix: str = option("", "", "before every key, to tell the robots of a fleet apart; a namespace in ROS 2")
    ros: Literal["none", "bridge", "rmw"] = option(
        "none",
        "none|bridge|rmw",
        "adds /tf, /map, /amcl_pose, /diagnostics behind zenoh-bridge-ros2dds or rmw_zenoh",
    )
    ros_domain: Annotated[int, Field(ge=0, le=232)] = option(0, "", "rmw: the ROS_DOMAIN_ID of the subscribers")
    tf_ahead_s: float = option(
        0.2,
        "s",
        "that map -> odom on /tf holds beyond its pose, till the next comes: at 10 Hz, and one is late",
    )
    fleet_every_s: Annotated[float, Field(gt=0)] = option(
        5.0,
        "s",
        "between two looks at what the robots of a fleet have mapped; a daemon saves its map once a minute or two",
    )
    odom_queue: int = option(6000, "messages", "60 s at 100 Hz: the pose needs every one, however late")
    scan_queue: int = option(100, "messages", "2.5 s at 40 Hz, a machine that stalls; of more every other is left out")
    security: SecurityConfig = field(default_factory=SecurityConfig)


@dataclass(frozen=True)
class RecordingConfig:
    """Input topics, and the directory of the daemon's runs."""

    directory: str = option("wayfi_runs", "path", "one folder a run below the working directory")
    part_mb: float = option(256.0, "MiB", "a part of the black box ends at this size, some hours of a planar laser")
    part_minutes: float = option(60.0, "min", "and at this age")
    budget_mb: float = option(20_000.0, "MiB", "of all runs together; over it the oldest files are deleted")
    keep_free_mb: float = option(100.0, "MiB", "free space left for others; below it nothing is recorded")
    odom: str = option("/odom", "topic", "REP 105's usual name")
    scan: str | list[str] = option("/scan", "topic, or topics", "as above; with several lasers all are used together")
    points: str = option("/points", "topic", "as above")
    wifi: str = option("/wifi", "topic", "wifi_msgs has no usual name")
    tf_static: str = option("/tf_static", "topic", "tf2's name")
    tf: str = option("/tf", "topic", "as above: mounts that are sent again and again, and odometry without messages")
    fix: str = option("/fix", "topic", "poses in map that a fiducial, a dock or a surveyor measured")
    initialpose: str = option("/initialpose", "topic", "RViz's and Nav2's name")

    @property
    def topics(self) -> dict[Sensor, str]:
        """The topic of each sensor, the first where there are several."""
        return {sensor: names[0] for sensor, names in self.every_topic.items()}

    @property
    def every_topic(self) -> dict[Sensor, tuple[str, ...]]:
        """All topics of each sensor."""
        topics = {sensor: getattr(self, sensor.value) for sensor in Sensor}
        return {sensor: (names,) if isinstance(names, str) else tuple(names) for sensor, names in topics.items()}


@dataclass(frozen=True)
class Config(SlamConfig):
    """The whole configuration: the sections of the estimation and those of the program."""

    radio: RadioConfig = field(default_factory=RadioConfig)
    rerun: RerunConfig = field(default_factory=RerunConfig)
    zenoh: ZenohConfig = field(default_factory=ZenohConfig)
    recording: RecordingConfig = field(default_factory=RecordingConfig)
