"""Measurements of ROS messages: covariances, quaternions and bounds on counts."""

import math
from typing import Any

import numpy as np
import pytest
from messages import EXAMPLES, float32s, ros_message, sensor_of

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.measurements import (
    LaserScan,
    Odometry,
    PoseFix,
    Sensor,
    WifiScan,
)
from wayfi.recordings.ros.codec import decode, encode
from wayfi.recordings.ros.codec_error import CodecError
from wayfi.recordings.ros.messages import TYPE_OF_SENSOR, TYPESTORE
from wayfi.recordings.ros.ros_messages import new_message
from wayfi.recordings.ros.topics import Encoding


def test_arrays_are_owned_and_writable() -> None:
    for example in EXAMPLES:
        decoded = decode(encode(example), sensor_of(example), Encoding.CDR)
        for name in decoded.__slots__:
            value = getattr(decoded, name)
            assert not isinstance(value, np.ndarray) or value.flags.writeable


def test_absurd_counts_are_refused_before_they_are_believed() -> None:
    beams = encode(LaserScan(0, "l", np.zeros(100_001, np.float32), 0.0, 0.1, 0.1, 30.0))
    with pytest.raises(CodecError, match="100001 beams"):
        decode(beams, Sensor.SCAN, Encoding.CDR)
    wifi = encode(WifiScan(0, "", (), float32s([]), float32s([])))
    with pytest.raises(CodecError, match="4294967295 readings"):
        decode(wifi[:-4] + b"\xff\xff\xff\xff", Sensor.WIFI, Encoding.CDR)


def odometry_message(quaternion_xyzw: tuple[float, ...], covariance: np.ndarray[Any, Any]) -> bytes:
    message = ros_message(EXAMPLES[0])
    message.pose.pose.orientation = new_message("geometry_msgs/msg/Quaternion", *quaternion_xyzw)
    message.pose.covariance = covariance
    return bytes(TYPESTORE.serialize_cdr(message, TYPE_OF_SENSOR[Sensor.ODOM]))


def odometry_of(quaternion_xyzw: tuple[float, ...], covariance: np.ndarray[Any, Any]) -> Odometry:
    decoded = decode(odometry_message(quaternion_xyzw, covariance), Sensor.ODOM, Encoding.CDR)
    assert isinstance(decoded, Odometry)
    return decoded


def test_covariance_takes_the_planar_rows_and_columns() -> None:
    full = np.arange(36.0)
    planar = odometry_of((0, 0, 0, 1), full).covariance
    assert planar is not None
    assert planar.tolist() == [[0, 1, 5], [6, 7, 11], [30, 31, 35]]
    assert odometry_of((0, 0, 0, 1), np.zeros(36)).covariance is None
    assert odometry_of((0, 0, 0, 1), np.full(36, np.nan)).covariance is None


def test_quaternions_need_not_be_of_unit_length_and_zeros_are_nan() -> None:
    assert odometry_of((0, 0, 3 * math.sin(0.5), 3 * math.cos(0.5)), np.zeros(36)).pose.theta == pytest.approx(1.0)
    assert math.isnan(odometry_of((0, 0, 0, 0), np.zeros(36)).pose.theta)
    assert not odometry_of((math.nan, 0, 0, 1), np.zeros(36)).pose.is_finite()
    assert -math.pi <= odometry_of((0, 0, 1, 0), np.zeros(36)).pose.theta < math.pi


def fix_of(quaternion_xyzw: tuple[float, ...], covariance: np.ndarray[Any, Any]) -> PoseFix:
    message = ros_message(PoseFix(0, Pose2(1.0, 2.0, 0.0)))
    message.pose.pose.orientation = new_message("geometry_msgs/msg/Quaternion", *quaternion_xyzw)
    message.pose.covariance = covariance
    data = bytes(TYPESTORE.serialize_cdr(message, TYPE_OF_SENSOR[Sensor.FIX]))
    decoded = decode(data, Sensor.FIX, Encoding.CDR)
    assert isinstance(decoded, PoseFix)
    return decoded


def test_a_pose_from_outside_has_the_planar_covariance_of_its_message_whatever_that_holds() -> None:
    full = np.arange(36.0)
    assert fix_of((0, 0, 0, 1), full).covariance == pytest.approx(np.array([[0, 1, 5], [6, 7, 11], [30, 31, 35]]))
    assert fix_of((0, 0, 0, 1), np.zeros(36)).covariance is None
    unsound = fix_of((0, 0, 0, 1), np.full(36, np.nan)).covariance
    assert unsound is not None
    assert np.isnan(unsound).all()


def test_a_pose_from_outside_may_lean_but_not_lie_on_its_side() -> None:
    leaning, lying = ((0, math.sin(tilt / 2), 0, math.cos(tilt / 2)) for tilt in (0.2, math.pi / 2))
    assert fix_of(leaning, np.zeros(36)).T_map_base.theta == pytest.approx(0.0)
    with pytest.raises(CodecError, match=r"tilted by 1\.57 rad; give that of the base"):
        fix_of(lying, np.zeros(36))
    with pytest.raises(CodecError, match="tilted by 3"):
        fix_of((1, 0, 0, 0), np.zeros(36))


def test_quaternions_of_poses_from_outside_are_normalised_and_zeros_are_nan() -> None:
    turned = fix_of((0, 0, 3 * math.sin(0.5), 3 * math.cos(0.5)), np.zeros(36))
    assert turned.T_map_base.theta == pytest.approx(1.0)
    for unknown in ((0, 0, 0, 0), (math.nan, 0, 0, 1)):
        assert not fix_of(unknown, np.zeros(36)).T_map_base.is_finite()
