"""Faults that last: warned of once when they begin and once when they end, for each sensor by itself."""

from collections.abc import Generator

from hypothesis import given
from hypothesis import strategies as st

from wayfi.frontends.complaints import SILENT, Complaints, Fault
from wayfi.frontends.events import Warned

S = 1_000_000_000
RULE = Fault(3, 5, "it is right again")


def complaints() -> Complaints:
    return Complaints("sensor {!r}", {"wrong": RULE}, 10.0)


def outcome(judging: Generator[Warned, None, bool]) -> tuple[list[Warned], bool]:
    """The warnings, and whether there is a complaint."""
    warnings = []
    while True:
        try:
            warnings.append(next(judging))
        except StopIteration as done:
            return warnings, done.value


@given(st.lists(st.booleans(), max_size=40))
def test_a_complaint_lasts_while_enough_of_the_latest_samples_are_faulty(samples: list[bool]) -> None:
    watched, warned = complaints(), []
    watched.heard("a")
    for k, faulty in enumerate(samples):
        warnings, lasts = outcome(watched.judge(k, "a", "wrong", [faulty], "it is wrong"))
        assert lasts == (sum(samples[max(0, k - RULE.window + 1) : k + 1]) >= RULE.faulty)
        warned += warnings
        assert lasts == (len(warned) % 2 == 1)
    assert [w.ends for w in warned] == [k % 2 == 1 for k in range(len(warned))]
    assert {w.complaint for w in warned} <= {"a.wrong"}
    texts = {True: "sensor 'a': it is right again", False: "sensor 'a': it is wrong"}
    assert all(w.text == texts[w.ends] for w in warned)


def test_sensors_are_judged_by_themselves() -> None:
    watched = complaints()
    watched.heard("a")
    watched.heard("b")
    assert outcome(watched.judge(0, "a", "wrong", [True] * 3, "it is wrong"))[1]
    assert outcome(watched.judge(0, "b", "wrong", [True, False], "it is wrong")) == ([], False)


def test_silence_begins_after_its_time_and_ends_with_the_next_message() -> None:
    watched, warned = complaints(), []
    for second in range(30):
        if second in (3, 20):
            watched.heard("a")
        warned += list(watched.pass_time(second * S))
    assert [(w.stamp_ns // S, w.complaint, w.ends) for w in warned] == [
        (13, f"a.{SILENT}", False),
        (20, f"a.{SILENT}", True),
    ]
    assert "no scan for 10 s" in warned[0].text


def test_a_pause_of_the_odometry_counts_for_a_second() -> None:
    watched = complaints()
    watched.heard("a")
    warned = [w for minute in range(10) for w in watched.pass_time(60 * minute * S)]
    assert warned == []
