"""Every option of the configuration, for the tests that go through all of them."""

from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from typing import Any

from wayfi.service.config import Config


def options(section: Any, path: str = "") -> Iterator[tuple[str, Any, Any]]:  # noqa: ANN401 - any section
    """Path, field and value of every option below a section."""
    for f in fields(section):
        value = getattr(section, f.name)
        if is_dataclass(value):
            yield from options(value, f"{path}{f.name}.")
        else:
            yield f"{path}{f.name}", f, value


OPTIONS = list(options(Config()))


def at(config: Config, path: str) -> Any:  # noqa: ANN401 - any value of the configuration
    value: Any = config
    for part in path.split("."):
        value = getattr(value, part)
    return value
