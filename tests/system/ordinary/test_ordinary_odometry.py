"""Odometry as ordinary robots send it: a twist alone, two sources, millimetres, restarts, and in /tf alone."""

import math
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import pytest
from drives import Arrival, Simulated
from ordinary_drives import fed, renamed

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.measurements import LaserScan, MovingTransforms, Odometry, StaticTransforms, Transform
from wayfi.frontends.odometry.accepted_odometry import HEADLESS
from wayfi.frontends.odometry.twist_odometry import ENDS, LEADS
from wayfi.recordings.ros.messages import ODOMETRY, TYPESTORE
from wayfi.recordings.ros.ros_messages import to_message

SOUND_M = 0.02  # ATE of the minute; 0.005 where everything is right
WHEELS_M = 0.4  # the same by wheels and WiFi alone; 0.13 where everything is right
NO_LASER = "lidar.enabled=false"


def odometry_of(drive: Simulated) -> list[Odometry]:
    return [a.measurement for a in drive.arrivals if isinstance(a.measurement, Odometry)]


def with_odometry(drive: Simulated, how: Callable[[Odometry, int], Odometry]) -> list[Arrival]:
    """The drive with other odometry; `how` gets each message and its number."""
    changed = iter([how(m, k) for k, m in enumerate(odometry_of(drive))])
    return [replace(a, measurement=next(changed)) if isinstance(a.measurement, Odometry) else a for a in drive.arrivals]


def twists(drive: Simulated) -> list[tuple[float, float, float]]:
    """The velocity at each message, from the one before."""
    out = [(0.0, 0.0, 0.0)]
    for before, after in pairwise(odometry_of(drive)):
        seconds, step = (after.stamp_ns - before.stamp_ns) * 1e-9, before.pose.between(after.pose)
        out.append((step.x / seconds, step.y / seconds, step.theta / seconds))
    return out


def oriented(arrival: Arrival, length: float) -> Arrival:
    """The same message of odometry, with a quaternion of this length; any other arrival as it is."""
    if not isinstance(arrival.measurement, Odometry):
        return arrival
    message, _ = to_message(arrival.measurement)
    message.pose.pose.orientation.z *= length
    message.pose.pose.orientation.w *= length
    return replace(arrival, data=bytes(TYPESTORE.serialize_cdr(message, ODOMETRY)))


# A twist alone


@pytest.mark.parametrize("pose", [Pose2(), Pose2(3.0, -2.0, 1.0)])
@pytest.mark.parametrize(("settings", "bound_m"), [((), 0.03), ((NO_LASER,), WHEELS_M)], ids=["laser", "wheels"])
def test_a_twist_is_integrated_where_the_pose_never_changes(
    settings: tuple[str, ...], bound_m: float, pose: Pose2, minute: Simulated
) -> None:
    speeds = twists(minute)
    done = fed(with_odometry(minute, lambda m, k: replace(m, pose=pose, twist=speeds[k])), *settings)
    assert done.ate_m(minute.truth) < bound_m
    assert done.told.count(LEADS) == 1
    assert done.dropped.get("/odom", {}) == {}


def test_a_twist_is_integrated_where_the_orientation_is_left_zero_as_well(minute: Simulated) -> None:
    speeds = twists(minute)
    zeros = with_odometry(minute, lambda m, k: replace(m, pose=Pose2(), twist=speeds[k]))
    done = fed([oriented(a, 0.0) for a in zeros])
    assert done.ate_m(minute.truth) < 0.03
    assert LEADS in done.told


@pytest.mark.parametrize("settings", [(), (NO_LASER,)], ids=["laser", "wheels"])
def test_a_twist_is_integrated_for_the_part_of_the_pose_that_is_not_filled(
    settings: tuple[str, ...], minute: Simulated
) -> None:
    speeds, bound_m = twists(minute), WHEELS_M if settings else 0.03

    def heading_alone(m: Odometry, k: int) -> Odometry:
        return replace(m, pose=Pose2(0.0, 0.0, m.pose.theta), twist=speeds[k])

    def position_alone(m: Odometry, k: int) -> Odometry:
        return replace(m, pose=Pose2(m.pose.x, m.pose.y, 0.0), twist=speeds[k])

    for how in (heading_alone, position_alone):
        done = fed(with_odometry(minute, how), *settings)
        assert LEADS in done.told
        assert done.ate_m(minute.truth) < bound_m


def test_a_pose_that_changes_after_all_is_used_again(minute: Simulated) -> None:
    """The twist is what was commanded, of a robot that is held: its pose stands, and that is right."""
    speeds, first = twists(minute), odometry_of(minute)[0].pose
    assert LEADS not in fed(with_odometry(minute, lambda m, k: replace(m, twist=speeds[k]))).told

    def held(m: Odometry, k: int) -> Odometry:
        return replace(m, pose=first, twist=(0.4, 0.0, 0.1)) if k < 100 else replace(m, twist=speeds[k])

    assert [text for text in fed(with_odometry(minute, held)).told if text in (LEADS, ENDS)] == [LEADS, ENDS]


def test_a_robot_that_stands_beside_a_noisy_gyroscope_does_not_move(minute: Simulated) -> None:
    first = odometry_of(minute)[0].pose
    done = fed(with_odometry(minute, lambda m, _: replace(m, pose=first, twist=(0.0, 0.0, 0.02))), NO_LASER)
    assert LEADS not in done.told


@pytest.mark.parametrize("length", [0.01, 0.5, 3.0])
def test_orientations_may_have_any_length(length: float, minute: Simulated) -> None:
    assert fed([oriented(a, length) for a in minute.arrivals]).ate_m(minute.truth) < SOUND_M


def test_orientations_that_are_left_zero_are_told_and_the_laser_leads(minute: Simulated) -> None:
    done = fed([oriented(a, 0.0) for a in minute.arrivals])
    assert HEADLESS in done.told
    assert any("the laser leads" in text for text in done.told)
    assert done.ate_m(minute.truth) < 0.1


# Restarts


@pytest.mark.parametrize("turn", [1.0, -1.6, 3.0])
@pytest.mark.parametrize("second", [6.0, 30.0])
def test_odometry_that_begins_anew_with_another_heading_is_told_and_harmless(
    second: float, turn: float, minute: Simulated
) -> None:
    messages = odometry_of(minute)
    k0 = next(k for k, m in enumerate(messages) if m.stamp_ns - messages[0].stamp_ns >= second * 1e9)
    dock = messages[k0].pose @ Pose2(0.2, 0.1, turn) @ messages[k0].pose.inverse()  # leads it a little aside, turned
    done = fed(with_odometry(minute, lambda m, k: m if k < k0 else replace(m, pose=dock @ m.pose)))
    assert done.ate_m(minute.truth) < SOUND_M
    assert any("began anew" in text for text in done.told)


def test_odometry_that_begins_anew_near_its_very_origin_is_told(minute: Simulated) -> None:
    messages = odometry_of(minute)
    near = next(k for k, m in enumerate(messages) if math.hypot(m.pose.x, m.pose.y) > 0.3)
    back = messages[near].pose.inverse()
    arrivals = with_odometry(minute, lambda m, k: m if k < near else replace(m, pose=back @ m.pose))
    done = fed(arrivals, NO_LASER)
    assert done.ate_m(minute.truth) < WHEELS_M
    assert any("began anew" in text for text in done.told)


# Two sources


@pytest.mark.parametrize(
    "other",
    [
        {"child_frame_id": "chassis"},
        {"frame_id": "odom_filtered"},
        {"child_frame_id": "robot2/base_link", "frame_id": "robot2/odom"},
    ],
)
@pytest.mark.parametrize("after_s", [0.003, 0.05])
def test_the_first_of_two_sources_is_kept_and_the_other_is_named(
    after_s: float, other: dict[str, str], minute: Simulated
) -> None:
    wrong = [
        renamed(a, pose=Pose2(0.3, -0.2, 0.1) @ a.measurement.pose @ Pose2(0.1, 0.0, 0.3), **other)
        .delayed(after_s)
        .stamped(after_s)
        for a in minute.arrivals
        if isinstance(a.measurement, Odometry)
    ]
    done = fed([*minute.arrivals, *wrong])
    assert done.ate_m(minute.truth) < SOUND_M
    assert done.dropped["/odom"] == {"another_source_is_used": len(wrong)}
    (told,) = [text for text in done.told if "second source" in text]
    assert all(repr(name) in told for name in other.values())


def test_a_source_takes_over_where_the_first_falls_silent(minute: Simulated) -> None:
    half = len(odometry_of(minute)) // 2
    messages = odometry_of(minute)
    arrivals = with_odometry(minute, lambda m, k: m if k < half else replace(m, child_frame_id="chassis"))
    done = fed(arrivals)
    assert any("is silent" in text for text in done.told)
    assert done.trajectory.stamps_ns[-1] == messages[-1].stamp_ns
    assert done.ate_m(minute.truth) < 0.1


# Millimetres


def in_millimetres(m: Odometry) -> Odometry:
    return replace(m, pose=Pose2(1000 * m.pose.x, 1000 * m.pose.y, m.pose.theta))


@pytest.mark.parametrize(("settings", "bound_m"), [((), 0.05), ((NO_LASER,), WHEELS_M)], ids=["laser", "wheels"])
def test_millimetres_are_told_and_converted(settings: tuple[str, ...], bound_m: float, minute: Simulated) -> None:
    done = fed(with_odometry(minute, lambda m, _: in_millimetres(m)), *settings)
    assert done.ate_m(minute.truth) < bound_m
    assert sum("looks as if it were in millimetres" in text for text in done.told) == 1


def test_a_twist_in_millimetres_is_converted(minute: Simulated) -> None:
    speeds = [(1000 * vx, 1000 * vy, omega) for vx, vy, omega in twists(minute)]
    done = fed(with_odometry(minute, lambda m, k: replace(m, pose=Pose2(), twist=speeds[k])))
    assert done.ate_m(minute.truth) < 0.05
    assert any("millimetres" in text for text in done.told)


def test_millimetres_may_be_configured(minute: Simulated) -> None:
    done = fed(with_odometry(minute, lambda m, _: in_millimetres(m)), "odometry.unit_m=0.001")
    assert done.ate_m(minute.truth) < SOUND_M
    assert not any("millimetres" in text or "leapt" in text for text in done.told)


# In /tf alone


def in_transforms(drive: Simulated, parent: str, child: str, from_s: float = 0.0) -> list[Arrival]:
    """The odometry as transforms, tipped by a little, beside a wheel that turns."""
    out = []
    for a in drive.arrivals:
        if not isinstance(a.measurement, Odometry) or a.second < from_s:
            continue
        T, stamp_ns = a.measurement.pose, a.measurement.stamp_ns
        half = 0.5 * T.theta
        pose = Transform(parent, child, (T.x, T.y, 0.1), (0.0, 0.0, 2 * math.sin(half), 2 * math.cos(half)))
        spin = Transform(child, "wheel", (0.0, 0.2, 0.0), (0.0, math.sin(a.second), 0.0, math.cos(a.second)))
        corrected = Transform("map", parent, (0.01 * a.second, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
        out.append(replace(a, measurement=MovingTransforms(stamp_ns, (spin, corrected, pose), (stamp_ns,) * 3)))
    return out


def mounted_on(drive: Simulated, child: str) -> list[Arrival]:
    """The drive without odometry, its laser mounted on another frame than base_link."""
    out = []
    for a in drive.without(Odometry):
        if isinstance(a.measurement, StaticTransforms):
            moved = tuple(replace(t, frame_id=child) for t in a.measurement.transforms)
            a = renamed(a, transforms=moved)
        out.append(a)
    return out


@pytest.mark.parametrize(
    ("parent", "child"),
    [
        ("odom", "base_footprint"),
        ("/odom", "/base_link"),
        ("robot1/odom", "robot1/base_link"),
        ("odom_combined", "chassis"),
    ],
)
def test_odometry_in_tf_alone_is_taken_from_there(parent: str, child: str, minute: Simulated) -> None:
    done = fed([*in_transforms(minute, parent, child), *mounted_on(minute, child)])
    assert done.ate_m(minute.truth) < SOUND_M
    assert done.trajectory.stamps_ns.tolist() == [m.stamp_ns for m in odometry_of(minute)]
    assert sum("it is taken from /tf" in text for text in done.told) == 1
    assert not any("laser leads" in text or "transform leads" in text for text in done.told)
    assert done.dropped == {}


def test_odometry_in_tf_serves_without_a_laser_and_in_a_drive_of_a_second(minute: Simulated) -> None:
    arrivals = in_transforms(minute, "odom", "base_link")
    assert fed(arrivals).ate_m(minute.truth) < WHEELS_M
    short = fed(arrivals[:10])
    assert len(short.trajectory) == 10


def test_messages_take_over_from_tf_and_tf_from_messages(minute: Simulated) -> None:
    late = [a for a in minute.arrivals if not isinstance(a.measurement, Odometry) or 20.0 <= a.second < 40.0]
    done = fed([*in_transforms(minute, "odom", "base_link"), *late])
    assert done.ate_m(minute.truth) < 0.05
    assert sum("it is taken from /tf" in text for text in done.told) >= 1
    assert sum("the wheels lead from here on, not /tf" in text for text in done.told) == 1
    assert len(done.trajectory) > 595


def test_tf_beside_messages_changes_nothing(minute: Simulated) -> None:
    alone = fed(minute.arrivals)
    beside = fed([*minute.arrivals, *in_transforms(minute, "odom", "base_link")])
    assert (beside.trajectory.poses == alone.trajectory.poses).all()
    assert beside.told == alone.told


def test_messages_that_a_network_holds_up_for_some_seconds_are_used_all_the_same(minute: Simulated) -> None:
    held = [
        a.delayed(max(0.0, 26.0 - a.second)) if 20.0 <= a.second < 26.0 and isinstance(a.measurement, Odometry) else a
        for a in minute.without(LaserScan)
    ]
    beside = fed([*in_transforms(minute, "odom", "base_link"), *held])
    assert not any("/tf" in text for text in beside.told)
    assert len(beside.trajectory) == len(odometry_of(minute))


def test_transforms_that_come_all_at_once_do_not_lead(minute: Simulated) -> None:
    late = [
        replace(a, at_ns=minute.arrivals[0].at_ns + 10_500_000_000)
        for a in in_transforms(minute, "odom", "base_link")
        if a.second < 10.0
    ]
    assert not any("/tf" in text for text in fed([*late, *minute.arrivals]).told)


def test_a_laser_that_leads_makes_way_for_tf(minute: Simulated) -> None:
    done = fed([*in_transforms(minute, "odom", "base_link", from_s=20.0), *minute.without(Odometry)])
    assert done.ate_m(minute.truth) < 0.1
    texts = [text for text in done.told if "leads" in text or "/tf" in text]
    assert ["laser leads" in texts[0], "taken from /tf" in texts[1], len(texts)] == [True, True, 2]
