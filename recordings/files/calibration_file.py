"""calibration.toml: what a drive has learnt of the wheels and the receivers, for the next one to start with."""

import json
import math
import tomllib
from pathlib import Path

import numpy as np

from wayfi.backend.errors import WayfiError
from wayfi.backend.graph.wheel_calibration import NAMES, WheelCalibration
from wayfi.frontends.calibration import Calibration
from wayfi.frontends.wifi.receivers import ReceiverOffset
from wayfi.recordings.files.atomic_files import write_text


class CalibrationError(WayfiError):
    """A calibration file that cannot be read."""


def calibration_toml(calibration: Calibration) -> str:
    """The text of calibration.toml."""
    wheels = calibration.wheels
    lines = ["# What is added to the wheels' word: scales are 1 + value, biases are turned in addition.", "[wheels]"]
    for name, value, sigma in zip(NAMES, wheels.values, wheels.sigmas, strict=True):
        lines.append(f"{name} = {{ value = {float(value)!r}, sigma = {float(sigma)!r} }}")
    lines += ["", "# How many dB each WiFi receiver reads above the first, which has sigma 0.", "[receivers]"]
    for receiver, found in calibration.receivers.items():
        key = json.dumps(receiver, ensure_ascii=False).replace("\x7f", "\\u007f")
        lines.append(f"{key} = {{ offset_db = {found.offset_db!r}, sigma_db = {found.sigma_db!r} }}")
    return "\n".join(lines) + "\n"


def write_calibration(path: Path, calibration: Calibration) -> None:
    """Write calibration.toml."""
    write_text(path, calibration_toml(calibration))


def read_calibration(path: Path) -> Calibration:
    """What a calibration.toml holds. Raises CalibrationError."""
    try:
        return parse_calibration(path.read_text(encoding="utf-8"), str(path))
    except OSError as error:
        raise CalibrationError(f"{path}: cannot be read: {error.strerror}") from None
    except UnicodeDecodeError as error:
        raise CalibrationError(f"{path}: is no calibration.toml of wayfi: {error}") from None


def parse_calibration(text: str, where: str) -> Calibration:
    """The text of a calibration.toml, receivers or not. Raises CalibrationError, naming `where` it comes from."""
    try:
        content = tomllib.loads(text)
        wheels = content["wheels"]
        values = np.array([float(wheels[name]["value"]) for name in NAMES])
        sigmas = np.array([float(wheels[name]["sigma"]) for name in NAMES])
        receivers = {name: _receiver(name, entry) for name, entry in content.get("receivers", {}).items()}
        return Calibration(WheelCalibration(values, sigmas), receivers)
    except (tomllib.TOMLDecodeError, AttributeError, KeyError, TypeError, ValueError, WayfiError) as error:
        raise CalibrationError(f"{where}: is no calibration.toml of wayfi: {error}") from None


def _receiver(name: str, entry: dict[str, float]) -> ReceiverOffset:
    found = ReceiverOffset(float(entry["offset_db"]), float(entry["sigma_db"]))
    if not (math.isfinite(found.offset_db) and 0 <= found.sigma_db < math.inf):
        raise CalibrationError(f"receiver {name!r} needs a finite offset and a finite sigma, not below zero")
    return found
