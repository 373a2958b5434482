"""The configuration as TOML and as nested mappings."""

from dataclasses import fields, is_dataclass
from typing import Any

import tomlkit
from tomlkit.container import Container
from tomlkit.items import Table

from wayfi.service.config.sections import Config


def config_toml(config: Config, explain: bool = False) -> str:
    """The configuration as TOML; with `explain`, each value has its unit and the reason for its default above it."""
    document = tomlkit.document()
    _add_section(document, config, explain)
    return tomlkit.dumps(document)


def config_dict(section: Any) -> dict[str, Any]:  # noqa: ANN401 - any section
    """A section, or the whole configuration, as nested mappings."""
    return {
        f.name: config_dict(value) if is_dataclass(value := getattr(section, f.name)) else value
        for f in fields(section)
    }


def _add_section(table: Container | Table, section: Any, explain: bool) -> None:  # noqa: ANN401 - any section
    """Add the values of `section` to `table`, then its inner sections as tables of their own."""
    values = {f.name: getattr(section, f.name) for f in fields(section)}
    for f in fields(section):
        if not is_dataclass(values[f.name]):
            if explain:
                unit = f"[{f.metadata['unit']}] " if f.metadata["unit"] else ""
                table.add(tomlkit.comment(unit + f.metadata["why"]))
            table.add(f.name, values[f.name])
    for name, value in values.items():
        if is_dataclass(value):
            inner = tomlkit.table()
            _add_section(inner, value, explain)
            table.add(name, inner)
