"""Messages are held back to the time between them; what no robot pauses for is not waited for, and is told."""

from collections.abc import Callable

import pytest
from live.clocks import Clock

from wayfi.frontends.measurements import SECOND_NS
from wayfi.service.replay import playback_rate
from wayfi.service.replay.playback_rate import PlaybackRate

STOPPED_AFTER_S = 0.2
EPOCH_NS = 1_700_000_000 * SECOND_NS


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    clock = Clock()
    monkeypatch.setattr(playback_rate, "time", clock)
    return clock


def never() -> bool:
    return False


def played_s(clock: Clock, playback: PlaybackRate, *log_times_s: float, stopped: Callable[[], bool] = never) -> float:
    begun_s = clock.now_s
    for log_time_s in log_times_s:
        playback.wait_for(round(log_time_s * SECOND_NS), stopped)
    return clock.now_s - begun_s


def test_messages_are_held_back_to_a_multiple_of_real_time(clock: Clock) -> None:
    playback = PlaybackRate(10.0)
    assert played_s(clock, playback, 5.0, 6.0, 8.0) == pytest.approx(0.3)
    assert playback.warnings == []
    assert playback.played_s == 3.0


@pytest.mark.parametrize(
    ("log_times_s", "told"),
    [
        ((0.0, 1.7e9, 1.7e9 + 1.0), "a gap of 53.9 years behind log time 0.0 s;"),
        ((1.7e9, 1.7e9 + 1.0, 1.7e9 + 901.0), "a gap of 900 s behind log time 1700000001.0 s;"),
        ((0.0, 100.0, 101.0, 1e4), "a gap of 100 s behind log time 0.0 s, and 1 more"),
    ],
)
def test_a_gap_is_told_and_not_waited_for(clock: Clock, log_times_s: tuple[float, ...], told: str) -> None:
    playback = PlaybackRate(10.0)
    assert played_s(clock, playback, *log_times_s) == pytest.approx(0.1)
    (line,) = playback.warnings
    assert told in line
    assert playback.played_s == 1.0


def test_a_leap_back_is_no_reason_to_hurry(clock: Clock) -> None:
    assert played_s(clock, PlaybackRate(10.0), 5000.0, 10.0, 12.0) == pytest.approx(0.2)


def test_a_wait_ends_when_it_is_stopped(clock: Clock) -> None:
    end_s = clock.now_s + STOPPED_AFTER_S
    assert played_s(clock, PlaybackRate(0.1), 0.0, 50.0, stopped=lambda: clock.now_s > end_s) < 0.5
