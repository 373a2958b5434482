"""Stamps stay monotone, whatever the clock does, and what is dropped has its reason."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wayfi.frontends.events import DropReason
from wayfi.frontends.measurements import SECOND_NS
from wayfi.frontends.odometry.odometry_config import ClockConfig
from wayfi.frontends.odometry.timebase import LAST_LEAP_NS, TimeBase

CONFIG = ClockConfig()
S = 1_000_000_000
MS = 1_000_000
LASTING_JUMP_NS, LASTING_MESSAGES = round(CONFIG.lasting_jump_s * S), CONFIG.lasting_messages
START = 1_700_000_000 * S


def accepted(time: TimeBase, stamps: list[int]) -> list[int]:
    return [s.stamp_ns for s in map(time.accept, stamps) if s.dropped is None]


@settings(deadline=None)
@given(st.lists(st.integers(-(10**12), 10**12), max_size=60))
def test_what_is_accepted_strictly_increases(stamps: list[int]) -> None:
    time, last = TimeBase(CONFIG), -(10**18)
    for stamp_ns in stamps:
        before = time.offset_ns
        stamped = time.accept(stamp_ns)
        assert stamped.shift_ns == time.offset_ns - before
        if stamped.dropped is None:
            assert stamped.stamp_ns > last
            last = stamped.stamp_ns
        assert time.newest_ns in (None, last)


@settings(deadline=None)
@given(st.sets(st.integers(0, 6 * 10**10), min_size=1, max_size=40))
def test_stamps_in_order_pass_as_they_are(stamps: set[int]) -> None:
    assert accepted(TimeBase(CONFIG), sorted(stamps)) == sorted(stamps)


def test_a_duplicate_and_a_single_jump_back_are_dropped() -> None:
    time = TimeBase(CONFIG)
    stamps = [START, START + S, START + S, START - 60 * S, START + 2 * S, START + S + 1, START + 3 * S]
    reasons = [time.accept(stamp).dropped for stamp in stamps]
    back = DropReason.STAMP_BACK
    assert reasons == [None, None, DropReason.DUPLICATE, back, None, back, None]
    assert time.offset_ns == 0


def test_a_clock_set_back_shifts_the_stamps_once() -> None:
    time, step, back = TimeBase(CONFIG), 100 * MS, 3600 * S
    before = [START + k * step for k in range(20)]
    assert accepted(time, before) == before
    after = [START - back + (20 + k) * step for k in range(20)]
    seen = [time.accept(stamp) for stamp in after]
    assert [s.dropped for s in seen[: LASTING_MESSAGES - 1]] == [DropReason.STAMP_BACK] * (LASTING_MESSAGES - 1)
    assert seen[LASTING_MESSAGES - 1].shift_ns == time.offset_ns == back
    assert [s.stamp_ns for s in seen[LASTING_MESSAGES - 1 :]] == [
        stamp + back for stamp in after[LASTING_MESSAGES - 1 :]
    ]
    assert time.offset_ns == back
    assert time.jumps == 1


def test_four_stamps_behind_are_dropped_and_the_fifth_comes_too_late_to_shift() -> None:
    time = TimeBase(CONFIG)
    accepted(time, [START, START + 100 * MS])
    for k in range(LASTING_MESSAGES - 1):
        assert time.accept(START - 10 * S + k).dropped is DropReason.STAMP_BACK
    assert time.accept(START + 200 * MS).dropped is None
    for k in range(LASTING_MESSAGES - 1):
        assert time.accept(START - 10 * S + k).dropped is DropReason.STAMP_BACK
    assert time.offset_ns == 0


@pytest.mark.parametrize("interval_ms", [20, 50, 100])
def test_a_lasting_jump_of_little_more_than_a_second_is_one(interval_ms: int) -> None:
    time = TimeBase(CONFIG)
    before = [START + k * interval_ms * MS for k in range(20)]
    after = [stamp + (20 * interval_ms - 1200) * MS for stamp in before]
    assert accepted(time, before + after)[-1] == START + 39 * interval_ms * MS
    assert time.offset_ns == 1200 * MS


def test_a_lasting_jump_of_less_than_a_second_is_waited_out() -> None:
    time = TimeBase(CONFIG)
    accepted(time, [START, START + LASTING_JUMP_NS])
    late = [START + k * MS for k in range(20)]
    assert accepted(time, late) == []
    assert time.offset_ns == 0
    assert accepted(time, [START + LASTING_JUMP_NS + 1]) == [START + LASTING_JUMP_NS + 1]


def test_a_gap_is_a_gap() -> None:
    time, stamps = TimeBase(CONFIG), [START, START + 50 * S, START + 51 * S]
    assert accepted(time, stamps) == stamps
    assert (time.offset_ns, time.jumps) == (0, 1)


def test_a_long_gap_is_accepted_when_the_next_messages_agree() -> None:
    stamps = [START, *(START + (3600 + k) * S for k in range(7))]
    assert accepted(TimeBase(CONFIG), stamps) == [START, *stamps[5:]]


def test_a_lone_stamp_far_ahead_is_dropped_and_moves_nothing() -> None:
    time = TimeBase(CONFIG)
    stamps = [START, START + S, START + 10**6 * S, *(START + k * S for k in range(2, 9))]
    reasons = [time.accept(stamp).dropped for stamp in stamps]
    assert reasons == [None, None, DropReason.STAMP_AHEAD, *[None] * 7]
    assert time.offset_ns == 0


def test_a_first_stamp_where_messages_end_begins_nothing() -> None:
    time = TimeBase(CONFIG)
    assert time.accept(LAST_LEAP_NS + 1).dropped is DropReason.STAMP_AHEAD
    assert accepted(time, [START]) == [START]


def test_no_leap_goes_to_where_messages_end_however_long_it_lasts() -> None:
    time = TimeBase(CONFIG)
    stamps = [START, *(LAST_LEAP_NS + k * S for k in range(1, 100))]
    assert accepted(time, stamps) == [START]
    assert accepted(time, [START + S]) == [START + S]


def test_a_clock_set_to_zero_and_right_again_is_followed_both_ways() -> None:
    time = TimeBase(CONFIG)
    right = [START + k * S for k in range(10)]
    assert accepted(time, right) == right
    assert len(accepted(time, [k * S for k in range(10)])) == 10 - LASTING_MESSAGES + 1
    assert time.offset_ns > START
    again = accepted(time, [START + k * S for k in range(20, 30)])
    assert len(again) == 10 - LASTING_MESSAGES + 1
    assert again[0] > right[-1]
    assert again[-1] == START + 29 * S
    assert time.offset_ns == 0


def test_a_clock_that_leaps_to_and_fro_does_not_run_away() -> None:
    time = TimeBase(CONFIG)
    ahead_ns = 60 * 365 * 86_400 * SECOND_NS
    strides_ns = (SECOND_NS, ahead_ns // 20)
    stamps = [near + k * s for s in strides_ns for _ in range(50) for near in (0, ahead_ns) for k in range(20)]
    kept = [time.accept(stamp_ns) for stamp_ns in stamps]
    assert max(stamped.stamp_ns for stamped in kept if not stamped.dropped) < ahead_ns + 86_400 * SECOND_NS
