"""Sources on one topic: the first is followed as long as it sends, and others are named once."""

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.measurements import SECOND_NS, Odometry
from wayfi.frontends.odometry.odometry_source import LEAST_MESSAGES, MOST_TOLD, OdometrySource

SILENT_S = 2.0


def message(second: float, child: str = "base_link", frame: str = "odom") -> Odometry:
    return Odometry(round(second * SECOND_NS), Pose2(), None, frame, child)


def test_the_first_is_followed_with_or_without_a_slash_and_the_other_told_once() -> None:
    source = OdometrySource(SILENT_S)
    assert source.follows(message(0.0)) == (True, "")
    assert source.follows(message(0.1, "/base_link", "/odom")) == (True, "")
    follows, told = source.follows(message(0.1, "chassis"))
    assert not follows
    assert told == (
        "a second source of odometry, with another child frame ('chassis' in 'odom'), is not used:"
        " the first ('base_link' in 'odom') is"
    )
    assert source.follows(message(0.2, "chassis")) == (False, "")
    assert "another frame ('base_link' in 'map')" in source.follows(message(0.3, frame="map"))[1]


def test_another_takes_over_when_the_first_is_silent_and_not_by_single_messages() -> None:
    source = OdometrySource(SILENT_S)
    source.follows(message(0.0))
    late = [source.follows(message(10.0 + k, "chassis")) for k in range(LEAST_MESSAGES)]
    assert [follows for follows, _ in late] == [False] * (LEAST_MESSAGES - 1) + [True]
    assert "is silent: that of 'chassis' in 'odom' is used from here on" in late[-1][1]
    assert source.follows(message(20.0))[0] is False


def test_messages_in_turn_do_not_change_the_source_whatever_their_stamps() -> None:
    source = OdometrySource(SILENT_S)
    for k in range(50):
        assert source.follows(message(0.1 * k))[0]
        assert not source.follows(message(1000.0 + k, "chassis"))[0]


def test_what_is_told_is_bounded() -> None:
    source = OdometrySource(SILENT_S)
    source.follows(message(0.0))
    told = [source.follows(message(0.1, f"frame_{k}"))[1] for k in range(100)]
    assert sum(map(bool, told)) == MOST_TOLD
