"""Odometry in /tf: known by the names of its frames, and bounded while it waits."""

import math

import pytest

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.measurements import SECOND_NS, MovingTransforms, Transform
from wayfi.frontends.odometry.transform_odometry import MOST_WAITING, TransformOdometry

TURNED = (0.0, 0.0, 3 * math.sin(0.25), 3 * math.cos(0.25))  # by 0.5 rad, of length 3


def moved(second: float, *pairs: tuple[str, str]) -> MovingTransforms:
    transforms = tuple(Transform(*pair, (second, 2.0, 0.3), TURNED) for pair in pairs)
    stamp_ns = round(second * SECOND_NS)
    return MovingTransforms(stamp_ns, transforms, (stamp_ns,) * len(pairs))


@pytest.mark.parametrize(
    "pair", [("odom", "base_link"), ("/odom", "/base_footprint"), ("r1/odom", "r1/base"), ("wheel_Odom", "chassis")]
)
def test_the_pose_of_the_base_in_odom_is_found(pair: tuple[str, str]) -> None:
    odometry = TransformOdometry()
    odometry.add(moved(1.0, ("map", pair[0]), ("base_link", "wheel"), pair))
    (m,) = odometry.take()
    assert (m.stamp_ns, m.frame_id, m.child_frame_id) == (SECOND_NS, pair[0].lstrip("/"), pair[1].lstrip("/"))
    assert m.pose.distance(Pose2(1.0, 2.0)) == 0.0
    assert m.pose.theta == pytest.approx(0.5)
    assert odometry.take() == []


def test_other_transforms_are_no_odometry() -> None:
    odometry = TransformOdometry()
    odometry.add(moved(1.0, ("map", "odom"), ("map", "base_link"), ("base_link", "wheel"), ("odom", "odom_filtered")))
    assert odometry.take() == []


def test_the_first_two_frames_stay_the_odometrys() -> None:
    odometry = TransformOdometry()
    odometry.add(moved(1.0, ("odom", "base_link"), ("odom_visual", "camera")))
    assert [m.child_frame_id for m in odometry.take()] == ["base_link"]


def test_waiting_is_counted_and_bounded() -> None:
    odometry = TransformOdometry()
    for k in range(MOST_WAITING + 20):
        odometry.add(moved(0.001 * k, ("odom", "base_link")))
    assert odometry.waited_ns == (MOST_WAITING - 1) * 1_000_000
    odometry.add(moved(3600.0, ("odom", "base_link")))
    assert odometry.waited_ns == (MOST_WAITING - 2) * 1_000_000 + SECOND_NS


def test_what_waits_is_later_than_the_newest_message_but_for_the_pose_that_it_joins() -> None:
    odometry = TransformOdometry()
    for k in range(10):
        odometry.add(moved(0.1 * k, ("odom", "base_link")))
    odometry.restart(650_000_000)
    assert odometry.waited_ns == 300_000_000
    odometry.add(moved(0.3, ("odom", "base_link")))  # come late, all of them older than the message
    odometry.add(moved(0.5, ("odom", "base_link")))
    assert odometry.waited_ns == 0
    odometry.add(moved(0.7, ("odom", "base_link")))
    assert [m.stamp_ns for m in odometry.take()] == [500_000_000, 700_000_000]


def test_a_quaternion_of_zeros_has_no_heading() -> None:
    odometry = TransformOdometry()
    zeros = Transform("odom", "base_link", (1.0, 2.0, 0.0), (0.0, 0.0, 0.0, 0.0))
    odometry.add(MovingTransforms(1, (zeros,), (1,)))
    assert math.isnan(odometry.take()[0].pose.theta)
