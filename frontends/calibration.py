"""The calibration of a robot's sensors as estimated on one drive: a prior for the next."""

from collections.abc import Mapping
from dataclasses import dataclass

from wayfi.backend.graph.wheel_calibration import WheelCalibration
from wayfi.frontends.wifi.receivers import ReceiverOffset


@dataclass(frozen=True, slots=True)
class Calibration:
    """The calibration of the wheels, and the offset of each WiFi receiver by its name, the reference first."""

    wheels: WheelCalibration
    receivers: Mapping[str, ReceiverOffset]
