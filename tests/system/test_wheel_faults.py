"""What goes wrong with the wheels: the laser is followed, the covariance covers it, the state says what disagrees."""

import math
import re

import numpy as np
import pytest
from legs import START, WALLS, Driven, Leg, follow

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.events import Warned
from wayfi.recordings.simulation.surfaces import Surfaces, box, join, moving, still

LAP = [Leg(12.0), Leg(turn=math.pi / 2), Leg(6.0), Leg(turn=math.pi / 2)]
TO_THE_CORNER = [Leg(wait_s=1.0), *LAP]
ON = [Leg(4.0), Leg(wait_s=1.0)]
SOUND_M = 0.05
TICK_M = 0.025  # at 0.5 m/s


def states(driven: Driven) -> list[str]:
    return [state for _, state, _ in driven.states]


def only_doubt(driven: Driven) -> tuple[float, str]:
    """When and why the pose was in doubt, which it was once, and no longer is."""
    assert states(driven) == ["TRACKING", "UNCERTAIN", "TRACKING"]
    second, _, reason = driven.states[1]
    return second, reason


def test_a_sound_drive_leaves_no_doubt() -> None:
    driven = follow([*TO_THE_CORNER, *ON])
    assert states(driven) == ["TRACKING"]
    assert driven.worst_m() < SOUND_M


FROZEN = Leg(6.0, wheels=0.0), Leg(turn=-1.0, wheels=0.0), Leg(turn=1.0, wheels=0.0)


def test_a_robot_whose_odometry_is_frozen_is_followed_by_the_laser() -> None:
    driven = follow([*TO_THE_CORNER, *FROZEN, *ON])
    began, ended = driven.start_s(5), driven.start_s(8)
    second, reason = only_doubt(driven)
    assert began < second < began + 3.0
    assert "the laser moves while the wheels stand still" in reason
    assert driven.worst_m() < 0.7  # a second of driving until it is looked at
    assert driven.worst_m(began + 3.0) < 0.35
    assert driven.worst_m(ended + 3.0) < 0.15


def test_wheels_that_go_the_other_way_are_not_believed() -> None:
    driven = follow([*TO_THE_CORNER, Leg(5.0, wheels=-1.0), *ON])
    _, reason = only_doubt(driven)
    assert "the wheels go the other way than the laser" in reason
    assert driven.worst_m(driven.start_s(6) + 2.0) < SOUND_M


def test_wheels_that_spin_on_the_spot_do_not_move_the_robot() -> None:
    driven = follow([*TO_THE_CORNER, Leg(wait_s=8.0, said=Pose2(TICK_M, 0.0, 0.0)), *ON])
    _, reason = only_doubt(driven)
    assert "while the laser stands still" in reason
    assert driven.worst_m(driven.start_s(6) + 1.0) < SOUND_M


CARRIED = Pose2(2.0, 1.5, 1.0)


def test_a_robot_that_is_carried_within_the_hall_is_found_again() -> None:
    driven = follow(
        [*TO_THE_CORNER, Leg(4.0), Leg(wait_s=2.0), Leg(wait_s=3.0, put=CARRIED), Leg(4.0), Leg(wait_s=3.0)]
    )
    carried = driven.start_s(7)
    second, reason = only_doubt(driven)
    assert carried < second < carried + 1.5
    assert "do not fit the map here" in reason
    claimed = [p for p in driven.published() if p.stamp_ns * 1e-9 > second and p.state == "TRACKING"]
    assert claimed
    assert max(abs(driven.error(p)).max() for p in claimed) < SOUND_M


CHAMBERS = np.concatenate([WALLS, box(-6.0, 0.5, -3.8, 5.0), box(-1.0, 3.8, 1.0, 5.0)])


def carried_across(put: Pose2) -> Driven:
    after = [Leg(wait_s=2.0, put=put), Leg(4.0), Leg(turn=1.0), Leg(2.0), Leg(wait_s=2.0)]
    return follow([*TO_THE_CORNER, Leg(wait_s=2.0), *after], still(CHAMBERS))


def test_a_robot_that_is_carried_across_the_hall_is_in_doubt_until_it_is_found_again() -> None:
    driven = carried_across(Pose2(-4.5, -1.0, 0.4))
    second, _ = only_doubt(driven)
    assert driven.start_s(6) < second < driven.start_s(6) + 1.5
    (warned,) = (event.text for event in driven.events if isinstance(event, Warned))
    assert re.fullmatch(r"the robot was found again, \d\.\d m from where the wheels put it", warned)
    assert max(abs(driven.error(driven.published()[-1]))) < SOUND_M


@pytest.mark.parametrize("put", [Pose2(-4.5, -1.0, 2.4), Pose2(-3.5, -3.0, 1.2), Pose2(0.0, -3.0, -0.7)])
def test_a_hall_that_looks_much_the_same_from_its_other_end_does_not_mislead_a_robot_that_was_carried(
    put: Pose2,
) -> None:
    driven = carried_across(put)
    second = driven.states[1][0]
    claimed = [p for p in driven.published() if p.stamp_ns * 1e-9 > second and p.state == "TRACKING"]
    assert all(abs(driven.error(p)).max() < SOUND_M for p in claimed)


def test_a_robot_that_is_pushed_aside_is_followed() -> None:
    pushed = START @ Pose2(4.0, 0.4, 0.2)
    driven = follow([Leg(wait_s=1.0), Leg(4.0), Leg(wait_s=2.0), Leg(wait_s=3.0, put=pushed), *ON])
    assert driven.worst_m(driven.start_s(3) + 1.5) < SOUND_M


def test_a_robot_that_is_carried_to_where_the_map_does_not_reach_is_uncertain_and_says_why() -> None:
    inside = Pose2(23.0, 3.0, -2.0)
    driven = follow(
        [*TO_THE_CORNER, Leg(wait_s=2.0), Leg(wait_s=3.0, put=inside), Leg(1.0), Leg(turn=1.0), Leg(wait_s=2.0)]
    )
    second, state, reason = driven.states[1]
    assert (state, "do not fit the map here" in reason) == ("UNCERTAIN", True)
    assert driven.start_s(6) < second < driven.start_s(6) + 1.5
    last = driven.published()[-1]
    assert last.state != "TRACKING"
    assert math.sqrt(last.covariance[0, 0]) > 1.5


def test_a_leap_of_the_odometry_is_told_until_scans_fit() -> None:
    driven = follow([*TO_THE_CORNER, Leg(3.0, leap=Pose2(3.0, 1.2, 0.0)), *ON])
    second, reason = only_doubt(driven)
    assert re.fullmatch(r"the odometry leapt 3\.[23] m", reason)
    assert driven.worst_m(second + 1.0) < SOUND_M


@pytest.mark.parametrize("turn", [1.4, -2.2, math.pi])
def test_a_turn_that_was_lost_in_a_gap_is_found(turn: float) -> None:
    lost = Leg(turn=turn, wait_s=1.0, wheels=0.0, silent=True)
    driven = follow([Leg(wait_s=1.0), Leg(5.0), lost, Leg(turn=-turn), Leg(wait_s=2.0), *ON])
    assert driven.worst_m(driven.start_s(3) + 2.0) < SOUND_M


def people_around(pose: Pose2, seconds: float) -> Surfaces:
    """Somebody walks past every two seconds, on either side, 0.7 m away; two stand in front all the time."""
    standing = still(np.concatenate([box(pose.x + 0.8, pose.y - 0.5, pose.x + 1.1, pose.y - 0.1)]))
    walks = [
        moving(box(pose.x - 4.0, pose.y + side - 0.15, pose.x - 3.6, pose.y + side + 0.15), t, t + 6.0, (1.2, 0.0))
        for t, side in zip(np.arange(0.0, seconds, 2.0), np.tile([0.9, -0.9], 1000), strict=False)
    ]
    return join([still(WALLS), standing, *walks])


def test_people_who_walk_past_do_not_move_a_robot_that_stands() -> None:
    people = people_around(START @ Pose2(3.0, 0.0, 0.0), 70.0)
    driven = follow([Leg(wait_s=1.0), Leg(3.0), Leg(wait_s=60.0)], people)
    standing = driven.start_s(2)
    assert driven.keyframes_between(standing + 0.5, standing + 59.0) <= 1  # for the last centimetres that it drove
    assert states(driven) == ["TRACKING"]
    assert driven.worst_m(standing) < SOUND_M
