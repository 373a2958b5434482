"""One frozen configuration: defaults < files < --set, unknown keys refused, saved with every run."""

import math
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, TypeAdapter, ValidationError

from wayfi.backend.errors import WayfiError
from wayfi.backend.options import option
from wayfi.frontends.measurements import Sensor
from wayfi.frontends.slam_config import SlamConfig
from wayfi.recordings.rerun.config import RerunConfig


class ConfigError(WayfiError):
    """A key that does not exist, a value that does not fit, or a file that is no TOML: exit 2."""


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


_ADAPTER = TypeAdapter(Config)


def load_config(files: Sequence[Path] = (), settings: Sequence[str] = (), base_toml: str = "") -> Config:
    """The defaults, overridden by `base_toml`, by TOML `files` and then by `settings` (`section.key=VALUE`).

    `base_toml` is the configuration that a daemon's black box carries. Raises ConfigError.
    """
    values: dict[str, Any] = _parse_toml(base_toml, "the black box's configuration")
    for path in files:
        _merge(values, _read_toml(path))
    for setting in settings:
        _merge(values, _parse_setting(setting))
    return config_of(values)


def config_of(values: Mapping[str, Any]) -> Config:
    """The configuration of a nested mapping, what it leaves out by default. Raises ConfigError."""
    _refuse_unknown(values, Config, "")
    try:
        config = _ADAPTER.validate_python(values)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"])
        raise ConfigError(f"{where}: {first['msg']} (it is {first['input']!r}); see `wayfi config`") from None
    _refuse_impossible(config, "")
    return config


def config_toml(config: Config, explain: bool = False) -> str:
    """The configuration as TOML; with `explain`, each value with its unit and the reason for its default."""
    return "\n".join(_toml_lines(config, "", explain)).lstrip("\n") + "\n"


def config_dict(config: Any) -> dict[str, Any]:  # noqa: ANN401 - any section
    """The configuration as nested mappings."""
    return {
        f.name: config_dict(value) if is_dataclass(value := getattr(config, f.name)) else value for f in fields(config)
    }


def _refuse_impossible(section: Any, path: str) -> None:  # noqa: ANN401 - any section
    for f in fields(section):
        value = getattr(section, f.name)
        if is_dataclass(value):
            _refuse_impossible(value, f"{path}{f.name}.")
        elif isinstance(value, float) and not math.isfinite(value):
            raise ConfigError(f"{path}{f.name}: must be finite (it is {value})")
        elif isinstance(value, int | float) and f.metadata["unit"] and value <= 0:
            raise ConfigError(f"{path}{f.name}: must be above zero, in {f.metadata['unit']} (it is {value})")
        elif f.name == "port" and not 0 < value < 65536:
            raise ConfigError(f"{path}{f.name}: must be from 1 to 65535 (it is {value})")
        elif f.name == "mount" and len(value) not in (0, 3):
            raise ConfigError(f"{path}{f.name}: must be empty or three numbers, x, y, theta (it is {value})")


def _read_toml(path: Path) -> dict[str, Any]:
    try:
        return _parse_toml(path.read_text(), str(path))
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror}") from None
    except UnicodeDecodeError as error:
        raise ConfigError(f"{path}: is no TOML: {error}") from None


def _parse_toml(text: str, where: str) -> dict[str, Any]:
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(f"{where}: is no TOML: {error}") from None


def _parse_setting(setting: str) -> dict[str, Any]:
    key, equals, text = setting.partition("=")
    parts = key.strip().split(".")
    if not equals or len(parts) < 2 or not all(parts):
        raise ConfigError(f"--set {setting}: must read section.key=VALUE, for example lidar.enabled=false")
    try:
        value = tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        value = text.strip()
    for part in reversed(parts):
        value = {part: value}
    return dict(value)


def _merge(into: dict[str, Any], other: Mapping[str, Any]) -> None:
    for key, value in other.items():
        if isinstance(value, Mapping) and isinstance(into.get(key), dict):
            _merge(into[key], value)
        else:
            into[key] = dict(value) if isinstance(value, Mapping) else value


def _refuse_unknown(values: Mapping[str, Any], section: type, path: str) -> None:
    known = {f.name: f for f in fields(section)}
    for key, value in values.items():
        if key not in known:
            raise ConfigError(f"{path}{key}: there is no such key; {path or 'the top level '}has {', '.join(known)}")
        inner = known[key].type
        if isinstance(inner, type) and is_dataclass(inner):
            if not isinstance(value, Mapping):
                raise ConfigError(f"{path}{key}: is a section, and cannot be set to {value!r}")
            _refuse_unknown(value, inner, f"{path}{key}.")


def _toml_lines(section: Any, path: str, explain: bool) -> Iterator[str]:  # noqa: ANN401 - any section
    inner = [f for f in fields(section) if is_dataclass(getattr(section, f.name))]
    plain = [f for f in fields(section) if f not in inner]
    if path and plain:
        yield f"\n[{path}]"
    for f in plain:
        if explain:
            unit = f" [{f.metadata['unit']}]" if f.metadata["unit"] else ""
            yield f"#{unit} {f.metadata['why']}"
        yield f"{f.name} = {_toml_value(getattr(section, f.name))}"
    for f in inner:
        yield from _toml_lines(getattr(section, f.name), f"{path}.{f.name}" if path else f.name, explain)


def _toml_value(value: Any) -> str:  # noqa: ANN401 - any value of a section
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"'
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_toml_value(v) for v in value) + "]"
    return repr(value)
