"""What a drive has learnt of the robot's own sensors, for the next one to start with."""

from collections.abc import Mapping
from dataclasses import dataclass

from wayfi.backend.graph.wheel_calibration import WheelCalibration
from wayfi.frontends.wifi.receivers import ReceiverOffset


@dataclass(frozen=True, slots=True)
class Calibration:
    """The wheels', and the offset of each WiFi receiver by its name, the reference first."""

    wheels: WheelCalibration
    receivers: Mapping[str, ReceiverOffset]
