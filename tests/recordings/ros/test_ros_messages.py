"""ROS messages of measurements: where the fields are, and what does not fit."""

import pytest
from messages import EXAMPLES, float32s, ros_message

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.measurements import (
    LaserScan,
    Measurement,
    Odometry,
    WifiScan,
)
from wayfi.recordings.ros.codec import encode
from wayfi.recordings.ros.codec_error import CodecError


def test_fields_stand_where_ros_has_them() -> None:
    odometry, scan, _, wifi, *_ = map(ros_message, EXAMPLES)
    assert (odometry.header.stamp.sec, odometry.header.stamp.nanosec) == (1_500_000_000, 123_456_789)
    assert odometry.pose.covariance[[0, 7, 35]].tolist() == [0.1, 0.2, 0.3]
    assert scan.angle_max == pytest.approx(-1.5 + 3 * 0.25)
    assert [reading.frequency for reading in wifi.readings] == [2412, 5180]


@pytest.mark.parametrize(
    "measurement",
    [
        Odometry(-1, Pose2()),
        Odometry(2**80, Pose2()),
        LaserScan(0, "l", float32s([1.0]), 1e300, 0.1, 0.1, 30.0),
        WifiScan(0, "w", ("aa:bb:cc:dd:ee:ff",), float32s([]), float32s([])),
    ],
)
def test_what_does_not_fit_its_message_cannot_be_encoded(measurement: Measurement) -> None:
    with pytest.raises(CodecError):
        encode(measurement)
