"""Stamps rise, sensor by sensor, in steps that a sensor makes."""

import pytest

import wayfi

T = 1_700_000_000_000_000_000
LEVELS = {"aa:bb:cc:dd:ee:ff": -61.0}


@pytest.fixture
def slam() -> wayfi.Slam:
    return wayfi.Slam()


@pytest.mark.parametrize("step_ns", [0, -1, -1_000_000_000])
def test_a_stamp_that_does_not_rise_is_refused_and_the_next_that_does_is_taken(slam: wayfi.Slam, step_ns: int) -> None:
    slam.add_odometry(T, 0.0, 0.0, 0.0)
    with pytest.raises(wayfi.ArgumentError, match=f"t_ns: must be later than the odometry before, at {T}; it is"):
        slam.add_odometry(T + step_ns, 0.0, 0.0, 0.0)
    assert slam.add_odometry(T + 20_000_000, 0.1, 0.0, 0.0)


def test_sensors_and_receivers_have_an_order_each(slam: wayfi.Slam) -> None:
    slam.add_odometry(T, 0.0, 0.0, 0.0)
    slam.add_wifi(T - 1, LEVELS, receiver="a")
    slam.add_wifi(T - 2, LEVELS, receiver="b")
    with pytest.raises(wayfi.ArgumentError, match="later than the wifi of 'a' before"):
        slam.add_wifi(T - 1, LEVELS, receiver="a")


@pytest.mark.parametrize(
    ("first", "step", "unit"),
    [(1_700_000_000, 1, "seconds"), (1_700_000_000_000, 100, "milliseconds"), (1_700_000_000_000_000, 20_000, "micro")],
)
def test_another_unit_than_nanoseconds_is_noticed_at_the_third_stamp(
    slam: wayfi.Slam, first: int, step: int, unit: str
) -> None:
    slam.add_odometry(first, 0.0, 0.0, 0.0)
    slam.add_odometry(first + step, 0.0, 0.0, 0.0)
    for _ in range(2):
        with pytest.raises(wayfi.ArgumentError, match=f"must be in nanoseconds.*is it in {unit}"):
            slam.add_odometry(first + 2 * step, 0.0, 0.0, 0.0)


def test_whole_seconds_that_come_twice_are_noticed(slam: wayfi.Slam) -> None:
    slam.add_odometry(1_700_000_000, 0.0, 0.0, 0.0)
    with pytest.raises(wayfi.ArgumentError, match=r"is it in seconds\?"):
        slam.add_odometry(1_700_000_000, 0.0, 0.0, 0.0)


def test_a_clock_that_begins_at_zero_and_a_burst_later_on_are_taken(slam: wayfi.Slam) -> None:
    for t_ns in (0, 20_000_000, 40_000_000, 40_000_001, 40_000_002):
        slam.add_odometry(t_ns, 0.0, 0.0, 0.0)
    assert slam.pose is not None


def test_a_clock_that_is_set_back_is_followed_as_in_a_recording(slam: wayfi.Slam) -> None:
    step_ns, back_ns = 20_000_000, 5_000_000_000
    for k in range(200):
        slam.add_odometry(T + k * step_ns - (back_ns if k >= 100 else 0), 0.01 * k, 0.0, 0.0)
    result = slam.finish()
    assert result.report["dropped"] == {"/odom": {"stamp_jumped_back": 4}}
    (warning,) = result.report["warnings"]
    assert warning.startswith("odometry: its clock was set back by 5.000 s")
    assert result.trajectory.stamps_ns[-1] == T + 199 * step_ns


def test_a_single_stamp_far_back_is_dropped_alone(slam: wayfi.Slam) -> None:
    for k in range(20):
        slam.add_odometry(T + k * 20_000_000 - (5_000_000_000 if k == 10 else 0), 0.0, 0.0, 0.0)
    assert slam.finish().report["dropped"] == {"/odom": {"stamp_jumped_back": 1}}


def test_each_laser_has_its_own_order(slam: wayfi.Slam) -> None:
    wall = [2.0] * 180
    slam.add_odometry(T, 0.0, 0.0, 0.0)
    for frame in ("front", "rear"):
        slam.add_scan(T, wall, angle_min=-1.5, angle_increment=0.0175, frame_id=frame)
    with pytest.raises(wayfi.ArgumentError, match="later than the scan of 'rear' before"):
        slam.add_scan(T, wall, angle_min=-1.5, angle_increment=0.0175, frame_id="rear")
