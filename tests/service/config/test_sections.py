"""Every option of the configuration has a unit, a reason and a sound default."""

import math
from dataclasses import FrozenInstanceError, fields
from typing import Any

import pytest
from configurations import OPTIONS

from wayfi.service.config import Config


@pytest.mark.parametrize(("path", "field"), [(path, f) for path, f, _ in OPTIONS], ids=[path for path, _, _ in OPTIONS])
def test_every_option_has_a_unit_and_the_reason_for_its_default(path: str, field: Any) -> None:  # noqa: ANN401
    assert isinstance(field.metadata["unit"], str), path
    assert len(field.metadata["why"]) > 5, path


def test_the_sections_are_those_promised() -> None:
    sections = {f.name for f in fields(Config)}
    assert sections >= {"odometry", "lidar", "wifi", "closure", "backend", "map", "rerun", "zenoh", "recording"}
    assert Config().lidar.enabled
    assert Config().wifi.enabled


def test_the_configuration_is_frozen_and_its_lists_are_its_own() -> None:
    with pytest.raises(FrozenInstanceError):
        Config().wifi.enabled = False  # type: ignore[misc]
    assert Config().zenoh.listen is not Config().zenoh.listen


def test_defaults_are_finite() -> None:
    assert all(math.isfinite(value) for _, _, value in OPTIONS if isinstance(value, float))
