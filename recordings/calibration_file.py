"""calibration.toml: what a drive has learnt of the wheels and the receivers, for the next one to start with."""

import tomllib
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from wayfi.backend.errors import WayfiError
from wayfi.backend.wheel_calibration import NAMES, WheelCalibration
from wayfi.recordings.files import write_text

RECEIVER_SIGMA_DB = 4.0  # phones of one kind were seen 2 to 4 dB apart


class CalibrationError(WayfiError):
    """A calibration file that cannot be read."""


def calibration_toml(wheels: WheelCalibration, receivers: Mapping[str, float]) -> str:
    """The text of calibration.toml; `receivers` maps each receiver to its offset in dB."""
    lines = ["# What is added to the wheels' word: scales are 1 + value, biases are turned in addition.", "[wheels]"]
    for name, value, sigma in zip(NAMES, wheels.values, wheels.sigmas, strict=True):
        lines.append(f"{name} = {{ value = {float(value)!r}, sigma = {float(sigma)!r} }}")
    lines += ["", "[receivers]"]
    for receiver, offset in sorted(receivers.items()):
        key = '"' + receiver.replace("\\", "\\\\").replace('"', '\\"') + '"'
        lines.append(f"{key} = {{ offset_db = {offset!r}, sigma_db = {RECEIVER_SIGMA_DB!r} }}")
    return "\n".join(lines) + "\n"


def write_calibration(path: Path, wheels: WheelCalibration, receivers: Mapping[str, float]) -> None:
    """Write calibration.toml."""
    write_text(path, calibration_toml(wheels, receivers))


def read_calibration(path: Path) -> WheelCalibration:
    """The wheels' part of a calibration.toml. Raises CalibrationError."""
    try:
        return parse_calibration(path.read_text(), str(path))
    except OSError as error:
        raise CalibrationError(f"{path}: cannot be read: {error.strerror}") from None


def parse_calibration(text: str, where: str) -> WheelCalibration:
    """The wheels' part of the text of a calibration.toml. Raises CalibrationError, naming `where` it comes from."""
    try:
        wheels = tomllib.loads(text)["wheels"]
        values = np.array([float(wheels[name]["value"]) for name in NAMES])
        sigmas = np.array([float(wheels[name]["sigma"]) for name in NAMES])
        return WheelCalibration(values, sigmas)
    except (tomllib.TOMLDecodeError, KeyError, TypeError, ValueError, WayfiError) as error:
        raise CalibrationError(f"{where}: is no calibration.toml of wayfi: {error}") from None
