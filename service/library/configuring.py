"""The configuration, as a caller gives it: a TOML file, and settings by name."""

import json
from collections.abc import Mapping
from pathlib import Path

from .arguments import ArgumentError

Given = str | Path | None


def files_of(config: Given) -> list[Path]:
    """The configuration's file, if there is one."""
    return [] if config is None else [Path(config)]


def settings_of(settings: Mapping[str, object]) -> list[str]:
    """Settings by `section.key` as the command line has them. Raises ArgumentError."""
    return [f"{_key(key)}={_toml(key, value)}" for key, value in settings.items()]


def _key(key: str) -> str:
    if "." not in key:
        example = 'Slam(**{"lidar.max_range_m": 12.0})'
        raise ArgumentError(f"{key}: there is no such argument; a setting is given by section.key, as in {example}")
    return key


def _toml(key: str, value: object) -> str:
    """`value` in TOML, which has JSON's texts, numbers and lists."""
    try:
        return json.dumps(value, ensure_ascii=False, default=_plain)
    except TypeError:
        raise ArgumentError(f"{key}: must be a text, a number, true or false, or a list; it is {value!r}") from None


def _plain(value: object) -> object:
    """A path as text, numpy's numbers and arrays as Python's. Raises TypeError."""
    if isinstance(value, Path):
        return str(value)
    if hasattr(value, "tolist"):
        return value.tolist()
    raise TypeError
