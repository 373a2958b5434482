"""Reading the configuration: defaults < files < --set; unknown keys and impossible values are refused by name."""

import math
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError

from wayfi.backend.errors import WayfiError
from wayfi.service.config.sections import Config


class ConfigError(WayfiError):
    """A key that does not exist, a value that does not fit, or a file that is not TOML; the CLI exits with 2."""


_ADAPTER = TypeAdapter(Config)


def load_config(files: Sequence[Path] = (), settings: Sequence[str] = (), base_toml: str = "") -> Config:
    """The defaults, overridden by `base_toml`, then by TOML `files`, then by `settings` (`section.key=VALUE`).

    `base_toml` is the configuration in a daemon's black box. Raises ConfigError.
    """
    values: dict[str, Any] = _parse_toml(base_toml, "the black box's configuration")
    for path in files:
        _merge(values, _read_toml(path))
    for setting in settings:
        _merge(values, _parse_setting(setting))
    return config_of(values)


def config_of(values: Mapping[str, Any]) -> Config:
    """The configuration with the values of a nested mapping, and defaults for the rest. Raises ConfigError."""
    _refuse_unknown(values, Config, "")
    try:
        config = _ADAPTER.validate_python(values)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"])
        raise ConfigError(f"{where}: {first['msg']} (it is {first['input']!r}); see `wayfi config`") from None
    _refuse_impossible(config, "")
    return config


SIGNED_UNIT = "dBm"  # a logarithm: of other units, settings are above zero
SHARE_UNIT = "share"  # of a whole, of which there is some and not all


def _refuse_impossible(section: Any, path: str) -> None:  # noqa: ANN401 - any section
    for f in fields(section):
        value = getattr(section, f.name)
        if is_dataclass(value):
            _refuse_impossible(value, f"{path}{f.name}.")
        elif complaint := _complaint(f.name, value, f.metadata["unit"]):
            raise ConfigError(f"{path}{f.name}: must be {complaint} (it is {value!r})")


def _complaint(name: str, value: Any, unit: str) -> str | None:  # noqa: ANN401 - any value of a section
    """What the value must be, where it is not."""
    entries = value if isinstance(value, list) else [value]
    if not all(math.isfinite(entry) for entry in entries if isinstance(entry, float)):
        return "finite"
    if isinstance(value, int | float) and (complaint := _out_of_range(value, unit)):
        return complaint
    if name == "port" and not 0 < value < 65536:
        return "from 1 to 65535"
    if name == "scan" and isinstance(value, list) and not (all(value) and 0 < len(value) == len(set(value))):
        return "a topic, or a list of different ones"
    if name == "mount" and len(value) not in (0, 3):
        return "empty or three numbers, x, y, theta"
    if not all(_is_unicode(entry) for entry in entries if isinstance(entry, str)):
        return "Unicode text"
    return None


def _out_of_range(value: float, unit: str) -> str | None:
    """What a number must be, where it is not; one without a unit counts or compares, and may be zero."""
    if unit == SHARE_UNIT and not 0 < value < 1:
        return "a share, above 0 and below 1"
    if unit == "" and value < 0:
        return "zero or above"
    if unit not in ("", SIGNED_UNIT) and value <= 0:
        return f"above zero, in {unit}"
    return None


def _is_unicode(text: str) -> bool:
    """False where `text` has lone surrogates: bytes of the command line that are not UTF-8, which TOML cannot hold."""
    return not any("\ud800" <= character <= "\udfff" for character in text)


def _read_toml(path: Path) -> dict[str, Any]:
    try:
        return _parse_toml(path.read_text(encoding="utf-8"), str(path))
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror}") from None
    except UnicodeDecodeError as error:
        raise ConfigError(f"{path}: is not TOML: {error}") from None


def _parse_toml(text: str, where: str) -> dict[str, Any]:
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(f"{where}: is not TOML: {error}") from None


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
