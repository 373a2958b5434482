"""The settings that a black box holds."""

import time
from pathlib import Path

import numpy as np
from live.daemons import odometry

from wayfi.backend.graph.wheel_calibration import WheelCalibration
from wayfi.frontends.calibration import Calibration
from wayfi.frontends.measurements import Sensor
from wayfi.frontends.wifi.receivers import ReceiverOffset
from wayfi.recordings.files.calibration_file import write_calibration
from wayfi.recordings.ros.topics import Encoding
from wayfi.service.blackbox.blackbox import BlackBox
from wayfi.service.config import load_config
from wayfi.service.replay.replay import settings_for
from wayfi.service.transport.message_queue import Received


def test_a_replay_takes_the_black_boxs_settings_unless_told_otherwise(tmp_path: Path) -> None:
    config = load_config((), ["lidar.enabled=false", "recording.odom=/wheels"])
    calibration = Calibration(
        WheelCalibration(np.array([0.1, 0.2, 0.3, 1 / 3]), np.array([1.0, 2.0, 3.0, 1e-7])),
        {"tablet": ReceiverOffset(0.0, 0.0), "phone": ReceiverOffset(-2.5, 1 / 3)},
    )
    with BlackBox(tmp_path, config, calibration) as blackbox:
        blackbox.write(Received(Sensor.ODOM, "/odom", Encoding.CDR, odometry(0), time.monotonic()))
    again, attached = settings_for(tmp_path, (), (), None)
    assert again == config
    assert attached is not None
    assert np.array_equal(attached.wheels.values, calibration.wheels.values)
    assert np.array_equal(attached.wheels.sigmas, calibration.wheels.sigmas)
    assert list(attached.receivers.items()) == list(calibration.receivers.items())
    write_calibration(tmp_path / "mine.toml", Calibration(WheelCalibration(np.zeros(4), np.ones(4)), {}))
    changed, mine = settings_for(tmp_path, (), ["lidar.enabled=true"], tmp_path / "mine.toml")
    assert changed.lidar.enabled
    assert changed.recording.odom == "/wheels"
    assert mine is not None
    assert not mine.wheels.values.any()
