"""The configuration, as a caller gives it: a TOML file or nested mappings, and settings by name."""

import json
import os
from collections.abc import Iterator, Mapping
from pathlib import Path

from .arguments import ArgumentError, path_of

Given = str | os.PathLike[str] | Mapping[str, object] | None
"""A configuration: a TOML file, or nested mappings such as `{"lidar": {"max_range_m": 12.0}}`; None: the defaults."""


def files_of(config: Given) -> list[Path]:
    """The configuration's file, if it is one. Raises ArgumentError for what is no configuration."""
    if config is None or isinstance(config, Mapping):
        return []
    if not isinstance(config, str | os.PathLike):
        raise ArgumentError(f"config: must be a TOML file, or a mapping of sections to settings; it is {config!r}")
    return [path_of(config, "config")]


def settings_of(config: Given, settings: Mapping[str, object]) -> list[str]:
    """The settings in `config`, then those by `section.key`, as the command line has them. Raises ArgumentError."""
    nested = config if isinstance(config, Mapping) else {}
    return [f"{_key(key)}={_toml(key, value)}" for given in (nested, settings) for key, value in _flat(given)]


def _flat(values: Mapping[str, object], prefix: str = "") -> Iterator[tuple[str, object]]:
    """Each value of nested mappings with its keys, joined by points."""
    for key, value in values.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value


def _key(key: str) -> str:
    if "." not in key:
        example = 'Slam(**{"lidar.max_range_m": 12.0})'
        raise ArgumentError(f"{key}: there is no such argument; a setting is given by section.key, as in {example}")
    return key


def _toml(key: str, value: object) -> str:
    """`value` in TOML, which has JSON's texts, numbers and lists."""
    try:
        if value is None:
            raise TypeError
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
