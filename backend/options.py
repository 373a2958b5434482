"""A configuration field that carries its unit and the reason for its default."""

from dataclasses import field
from typing import Any


def option(default: Any, unit: str, why: str) -> Any:  # noqa: ANN401 - the field's own annotation is its type
    """A dataclass field with `default`, its `unit` ("" for none) and `why` that default was chosen."""
    metadata = {"unit": unit, "why": why}
    if isinstance(default, list | dict):
        return field(default_factory=lambda: type(default)(default), metadata=metadata)
    return field(default=default, metadata=metadata)
