"""calibration.toml: what a drive has learnt about the wheels and the WiFi receivers; the next one starts with it."""

import math
import tomllib
from pathlib import Path

import numpy as np
import tomlkit
from tomlkit.items import InlineTable

from wayfi.backend.errors import WayfiError
from wayfi.backend.graph.wheel_calibration import NAMES, WheelCalibration
from wayfi.frontends.calibration import Calibration
from wayfi.frontends.wifi.receivers import ReceiverOffset
from wayfi.recordings.files.atomic_files import write_text


class CalibrationError(WayfiError):
    """A calibration file that cannot be read."""


def calibration_toml(calibration: Calibration) -> str:
    """The text of calibration.toml."""
    wheels = tomlkit.table()
    wheels.comment("true distance = (1 + distance_scale) measured; true turn = (1 + turn_scale) measured + biases")
    for name, value, sigma in zip(NAMES, calibration.wheels.values, calibration.wheels.sigmas, strict=True):
        wheels.add(name, _inline(value=float(value), sigma=float(sigma)))
    receivers = tomlkit.table()
    receivers.comment("dB that each WiFi receiver reads above the first, which has sigma 0")
    for name, offset in calibration.receivers.items():
        receivers.add(name, _inline(offset_db=offset.offset_db, sigma_db=offset.sigma_db))
    return tomlkit.dumps({"wheels": wheels, "receivers": receivers})


def _inline(**values: float) -> InlineTable:
    """An inline table: `{name = value, ...}`."""
    table = tomlkit.inline_table()
    table.update(values)
    return table


def write_calibration(path: Path, calibration: Calibration) -> None:
    """Write calibration.toml. Raises OSError."""
    write_text(path, calibration_toml(calibration))


def read_calibration(path: Path) -> Calibration:
    """The calibration in a calibration.toml. Raises CalibrationError."""
    try:
        return parse_calibration(path.read_text(encoding="utf-8"), str(path))
    except OSError as error:
        raise CalibrationError(f"{path}: cannot be read: {error.strerror}") from None
    except UnicodeDecodeError as error:
        raise CalibrationError(f"{path}: is not a calibration.toml of wayfi: {error}") from None


def parse_calibration(text: str, where: str) -> Calibration:
    """The calibration in the text of a calibration.toml, which may have no receivers.

    Raises CalibrationError, which names `where` the text comes from.
    """
    try:
        content = tomllib.loads(text)
        wheels = content["wheels"]
        values = np.array([float(wheels[name]["value"]) for name in NAMES])
        sigmas = np.array([float(wheels[name]["sigma"]) for name in NAMES])
        receivers = {name: _receiver(name, entry) for name, entry in content.get("receivers", {}).items()}
        return Calibration(WheelCalibration(values, sigmas), receivers)
    except (tomllib.TOMLDecodeError, AttributeError, KeyError, TypeError, ValueError, WayfiError) as error:
        raise CalibrationError(f"{where}: is not a calibration.toml of wayfi: {error}") from None


def _receiver(name: str, entry: dict[str, float]) -> ReceiverOffset:
    found = ReceiverOffset(float(entry["offset_db"]), float(entry["sigma_db"]))
    if not (math.isfinite(found.offset_db) and 0 <= found.sigma_db < math.inf):
        raise CalibrationError(f"receiver {name!r} needs a finite offset and a finite sigma, not below zero")
    return found
