"""Which messages extend the path: the same for the pipeline and for whoever goes on from a copy of its state."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from odometry_streams import FAULT_LISTS, FAULTS, STEP, stream

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.events import Dropped, DropReason, PosePublished
from wayfi.frontends.measurements import SECOND_NS, Odometry
from wayfi.frontends.odometry.accepted_odometry import Accepted, AcceptedOdometry
from wayfi.frontends.odometry.odometry_config import OdometryConfig
from wayfi.frontends.pipeline import Pipeline
from wayfi.frontends.slam_config import SlamConfig

CONFIG = OdometryConfig()
SOUND = stream(["sound"] * 20)


def accept_all(odometry: AcceptedOdometry, messages: list[Odometry]) -> list[Accepted]:
    return [odometry.accept(m) for m in messages]


def test_the_streams_of_these_tests_have_every_fault() -> None:
    blocks = [[fault, *["sound"] * 8] for fault in FAULTS]
    accepted = accept_all(AcceptedOdometry(CONFIG), stream([fault for block in blocks for fault in block]))
    assert {one.dropped for one in accepted} == {
        *(None, DropReason.NON_FINITE, DropReason.IMPLAUSIBLE_MOTION, DropReason.DUPLICATE),
        *(DropReason.STAMP_BACK, DropReason.STAMP_AHEAD),
    }
    assert any(one.shift_ns for one in accepted)
    assert not all(one.plausible for one in accepted)


@settings(deadline=None, max_examples=40)
@given(FAULT_LISTS)
def test_the_pipeline_publishes_what_is_accepted_and_drops_the_rest_for_the_same_reasons(faults: list[str]) -> None:
    pipeline, odometry = Pipeline(SlamConfig()), AcceptedOdometry(CONFIG)
    for m in stream(faults):
        events, accepted = pipeline.process(m), odometry.accept(m)
        published = [(e.stamp_ns, e.T_odom_base) for e in events if isinstance(e, PosePublished)]
        assert published == ([(accepted.point.stamp_ns, m.pose)] if accepted.point else [])
        dropped = [(e.stamp_ns, e.reason) for e in events if isinstance(e, Dropped)]
        assert dropped == ([(accepted.stamp_ns, accepted.dropped)] if accepted.dropped else [])
        estimate = pipeline.new_estimate(1)
        assert estimate is None or estimate.odometry.path.latest == odometry.path.latest


@settings(deadline=None)
@given(FAULT_LISTS, st.integers(0, 80))
def test_a_copy_goes_on_as_the_original_does(faults: list[str], at: int) -> None:
    messages, odometry = stream(faults), AcceptedOdometry(CONFIG)
    accept_all(odometry, messages[:at])
    tip = odometry.tip()
    assert accept_all(tip, messages[at:]) == accept_all(odometry, messages[at:])
    assert tip.received == odometry.received == len(messages)


@settings(deadline=None)
@given(FAULT_LISTS)
def test_a_message_has_a_point_or_a_reason_and_stamps_rise(faults: list[str]) -> None:
    accepted = accept_all(AcceptedOdometry(CONFIG), stream(faults))
    assert all((one.point is None) is (one.dropped is not None) for one in accepted)
    stamps = [one.stamp_ns for one in accepted if one.point]
    assert stamps == sorted(set(stamps))
    assert [one.point.stamp_ns for one in accepted if one.point] == stamps


def test_the_wheels_join_without_motion_where_the_laser_led_and_only_once() -> None:
    odometry = AcceptedOdometry(CONFIG)
    odometry.begin_stand_in()
    first_ns = SOUND[0].stamp_ns
    odometry.follow_laser(first_ns - SECOND_NS, Pose2(7.0, 0.0, 0.0))
    led = odometry.follow_laser(first_ns - 1, Pose2(7.3, 0.0, 0.0))
    tip = odometry.tip()
    after = accept_all(odometry, SOUND[:3])
    assert led.point is not None
    assert [one.point.path_m for one in after if one.point] == pytest.approx(
        [led.point.path_m + k * STEP.x for k in range(3)]
    )
    assert [one.ends_stand_in for one in after] == [True, False, False]
    assert accept_all(tip, SOUND[:3]) == after


def test_a_message_that_is_dropped_does_not_end_the_lead_but_a_late_one_does() -> None:
    odometry = AcceptedOdometry(CONFIG)
    odometry.begin_stand_in()
    odometry.follow_laser(SOUND[2].stamp_ns, Pose2())
    assert not odometry.accept(Odometry(SOUND[0].stamp_ns, Pose2(float("nan"), 0.0, 0.0))).ends_stand_in
    late = odometry.accept(SOUND[1])
    assert (late.dropped, late.ends_stand_in) == (DropReason.TOO_LATE, True)


def test_a_leap_is_told_and_counts_as_no_motion() -> None:
    *_, before, after = accept_all(AcceptedOdometry(CONFIG), stream(["sound", "sound", "leap"]))
    assert before.plausible
    assert not after.plausible
    assert before.point is not None
    assert after.point is not None
    assert after.point.path_m == before.point.path_m


def test_wheels_that_were_silent_tell_the_whole_motion_whatever_led_meanwhile() -> None:
    odometry = AcceptedOdometry(CONFIG)
    accept_all(odometry, SOUND[:5])
    before = odometry.path.latest
    odometry.begin_stand_in()
    odometry.follow_laser(SOUND[6].stamp_ns, Pose2())
    odometry.follow_laser(SOUND[8].stamp_ns, Pose2(0.0, 0.01, 0.1))
    tip = odometry.tip()
    after = accept_all(odometry, SOUND[12:14])
    motion = before.motion_to(after[0].point) if before and after[0].point else None
    assert motion is not None
    expected = SOUND[4].pose.between(SOUND[12].pose)
    np.testing.assert_allclose(motion.pose.array(), expected.array(), atol=1e-9)
    np.testing.assert_allclose(motion.path_m, 8 * STEP.x, rtol=0.1)
    assert after[0].plausible
    assert accept_all(tip, SOUND[12:14]) == after


def test_wheels_that_began_anew_while_they_were_silent_say_nothing_of_the_way() -> None:
    odometry = AcceptedOdometry(CONFIG)
    odometry.accept(Odometry(0, Pose2(7.0, 0.0, 0.0)))
    odometry.accept(Odometry(SECOND_NS, Pose2(7.5, 0.0, 0.0)))
    odometry.begin_stand_in()
    odometry.follow_laser(4 * SECOND_NS, Pose2())
    led = odometry.follow_laser(5 * SECOND_NS, Pose2(0.6, 0.0, 0.0))
    back = odometry.accept(Odometry(6 * SECOND_NS, Pose2(0.1, 0.0, 0.0)))
    assert led.point is not None
    assert back.point is not None
    assert back.point.T_path_base == led.point.T_path_base


SPEED_M_S = 1.0


def regained(led: Pose2, back: Pose2, silent_s: int = 5) -> bool:
    """Whether wheels that drove at a steady speed, were silent, and then give `back` from there, move what `led`."""
    odometry = AcceptedOdometry(CONFIG)
    before = Pose2(20.0, 0.0, 0.0)
    for second in range(4):
        odometry.accept(Odometry(second * SECOND_NS, before @ Pose2(SPEED_M_S * (second - 3), 0.0, 0.0)))
    odometry.begin_stand_in()
    odometry.follow_laser(5 * SECOND_NS, Pose2())
    last = odometry.follow_laser((2 + silent_s) * SECOND_NS, led).point
    point = odometry.accept(Odometry((3 + silent_s) * SECOND_NS, before @ back)).point
    assert last is not None
    assert point is not None
    return point.T_path_base != last.T_path_base


@pytest.mark.parametrize(
    ("led", "back", "silent_s", "told"),
    [
        pytest.param(Pose2(0.1, 0.0, 0.0), Pose2(5.0, 0.0, 0.0), 5, True, id="they counted on"),
        pytest.param(Pose2(-5.6, 0.0, 0.0), Pose2(5.0, 0.0, 0.0), 5, True, id="the laser went the other way"),
        pytest.param(Pose2(5.0, 0.0, 0.0), Pose2(), 5, False, id="they stood while the laser moved"),
        pytest.param(Pose2(5.0, 0.0, 0.0), Pose2(5.0, 0.0, 0.2), 5, False, id="they turned otherwise"),
        pytest.param(Pose2(5.0, 0.0, 0.0), Pose2(-15.0, 0.0, 0.0), 5, False, id="they began anew"),
        pytest.param(Pose2(0.1, 0.0, 0.0), Pose2(16.0, 0.0, 0.0), 16, False, id="they were silent for long"),
    ],
)
def test_wheels_tell_the_way_of_a_silence_only_if_they_counted_on(
    led: Pose2, back: Pose2, silent_s: int, told: bool
) -> None:
    assert regained(led, back, silent_s) == told
