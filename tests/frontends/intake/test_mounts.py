"""Mounts: what cannot be is refused, what is known is used, and what is not is warned of once."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.events import DropReason
from wayfi.frontends.frames.frame_tree import FURTHEST_M, MOST_FRAMES
from wayfi.frontends.intake.mounts import MOST_WARNED, Mounts
from wayfi.frontends.lidar.lidar_config import LidarConfig
from wayfi.frontends.measurements import LaserScan, Transform

UPRIGHT = (0.0, 0.0, 0.0, 1.0)
AHEAD = (0.3, 0.0, 0.2)


def transform(
    translation: tuple[float, float, float] = AHEAD,
    rotation: tuple[float, float, float, float] = UPRIGHT,
    child: str = "laser",
) -> Transform:
    return Transform("base_link", child, translation, rotation)


def scan(frame_id: str) -> LaserScan:
    return LaserScan(0, frame_id, np.ones(3, np.float32), 0.0, 0.1, 0.05, 30.0)


@pytest.mark.parametrize(
    ("refused", "reason"),
    [
        (transform((math.nan, 0.0, 0.0)), DropReason.NON_FINITE),
        (transform(rotation=(0.0, math.inf, 0.0, 1.0)), DropReason.NON_FINITE),
        (transform((0.0, 0.0, FURTHEST_M + 1)), DropReason.ABSURD_MOUNT),
        (transform((1e200, 1e200, 0.0)), DropReason.ABSURD_MOUNT),
        (transform(rotation=(0.0, 0.0, 0.0, 0.0)), DropReason.ABSURD_MOUNT),
        (transform(rotation=(0.0, 0.0, 0.0, 1e200)), DropReason.ABSURD_MOUNT),
    ],
)
def test_what_cannot_be_is_refused_and_what_was_known_stays(refused: Transform, reason: DropReason) -> None:
    mounts = Mounts(LidarConfig())
    assert mounts.add(transform()) is None
    assert mounts.add(refused) is reason
    np.testing.assert_array_equal(mounts.of("laser").translation, AHEAD)


@given(st.floats(-math.pi, math.pi), st.floats(0.01, 100.0))
def test_a_quaternion_of_any_length_gives_the_rotation(theta: float, length: float) -> None:
    mounts = Mounts(LidarConfig())
    turned = (0.0, 0.0, length * math.sin(theta / 2), length * math.cos(theta / 2))
    assert mounts.add(transform(rotation=turned)) is None
    rotation = mounts.of("laser").rotation
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
    assert math.remainder(mounts.of("laser").planar.theta - theta, 2 * math.pi) == pytest.approx(0.0, abs=1e-9)


def test_the_frames_that_are_remembered_are_bounded_and_the_known_ones_still_change() -> None:
    mounts = Mounts(LidarConfig())
    for k in range(MOST_FRAMES):
        assert mounts.add(transform(child=f"sensor_{k}")) is None
    assert mounts.add(transform(child="one_more")) is DropReason.TOO_MANY_FRAMES
    assert mounts.add(transform((1.0, 0.0, 0.0), child="sensor_0")) is None
    assert mounts.of("sensor_0").planar == Pose2(1.0, 0.0, 0.0)


def test_the_configuration_goes_before_what_is_received() -> None:
    mounts = Mounts(LidarConfig(mount=[0.1, 0.2, 0.3]))
    assert mounts.add(transform()) is None
    assert mounts.of("laser").planar.array() == pytest.approx([0.1, 0.2, 0.3])
    assert mounts.knows("anything")


def test_an_unknown_frame_is_at_base_link_and_warned_of_once() -> None:
    mounts = Mounts(LidarConfig())
    assert mounts.of("laser").planar == Pose2()
    assert len(list(mounts.warn_of_unknown(scan("laser")))) == 1
    assert list(mounts.warn_of_unknown(scan("laser"))) == []
    assert list(mounts.warn_of_unknown(scan("base_link"))) == []
    warned = [len(list(mounts.warn_of_unknown(scan(f"laser_{k}")))) for k in range(2 * MOST_WARNED)]
    assert sum(warned) == MOST_WARNED - 1


def chained(*edges: tuple[str, str]) -> Mounts:
    mounts = Mounts(LidarConfig())
    for parent, child in edges:
        mounts.add(Transform(parent, child, AHEAD, UPRIGHT))
    return mounts


def test_the_base_is_the_odometrys_where_transforms_lead_from_it() -> None:
    mounts = chained(("base_footprint", "base_link"), ("base_link", "laser"))
    assert mounts.of("laser").planar.x == pytest.approx(0.3)
    mounts.follow_odometry("/base_footprint")
    assert mounts.of("/laser").planar.x == pytest.approx(0.6)
    assert list(mounts.warn_of_unknown(scan("laser"))) == []


def test_a_frame_that_is_set_goes_before_the_odometrys() -> None:
    mounts = Mounts(LidarConfig(), "/chassis")
    mounts.add(Transform("chassis", "laser", AHEAD, UPRIGHT))
    mounts.follow_odometry("wheels")
    assert mounts.knows("laser")
    assert list(mounts.warn_of_unknown(scan("laser"))) == []


def test_sweeps_wait_until_their_mount_is_known_or_they_have_waited() -> None:
    mounts = Mounts(LidarConfig())
    assert mounts.awaits("laser")
    assert not mounts.awaits("base_link")
    mounts.settle("/laser")
    assert not mounts.awaits("laser")
    assert not chained(("base_link", "laser")).awaits("laser")


@pytest.mark.parametrize(("x", "z", "changes"), [(0.0, 0.3, 0), (0.3, 0.0, 1)])
def test_a_height_alone_changes_nothing_for_a_planar_scan(x: float, z: float, changes: int) -> None:
    mounts = Mounts(LidarConfig())
    mounts.mark_used(scan("laser"))
    mounts.add(transform((x, 0.0, z)))
    assert len(mounts.changes()) == changes
    assert mounts.changes() == []


FRAMES = st.sampled_from(["base_link", "base_footprint", "/laser", "laser", "mast", "", "odom"])
MOVES = st.sampled_from([(0.0, 0.0, 0.0), (0.5, 0.0, 0.0), (0.0, math.nan, 0.0), (1e300, 0.0, 0.0), (99.0, 99.0, 0.0)])
TURNS = st.sampled_from([UPRIGHT, (0.0, 0.0, 2.0, 0.0), (0.0, 0.0, 0.0, 0.0), (math.inf, 0.0, 0.0, 1.0)])


@given(st.lists(st.tuples(st.builds(Transform, FRAMES, FRAMES, MOVES, TURNS), st.booleans(), FRAMES)))
def test_no_transforms_break_anything(sent: list[tuple[Transform, bool, str]]) -> None:
    mounts = Mounts(LidarConfig())
    for t, declared, base in sent:
        mounts.add(t, declared)
        mounts.follow_odometry(base)
        assert all("'laser'" in text for text in mounts.changes())
        list(mounts.warn_of_unknown(scan("laser")))
        mounts.mark_used(scan("laser"))
        mount = mounts.of("laser")
        assert np.isfinite(mount.rotation).all()
        assert np.linalg.norm(mount.translation) <= FURTHEST_M
