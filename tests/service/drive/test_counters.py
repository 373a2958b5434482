"""The counters stay small over weeks."""

from wayfi.backend.graph.health import FailureCategory, State
from wayfi.frontends.events import StateChanged, Warned
from wayfi.frontends.measurements import Sensor
from wayfi.service.drive.counters import MOST_CHANGES, MOST_TEXT, MOST_WARNINGS, Counters

TOPICS = {sensor: f"/{sensor}" for sensor in Sensor}


def test_each_warning_stands_once_in_the_order_they_first_came() -> None:
    counters = Counters(TOPICS)
    for text in ("first", "second", "first", "third", "first"):
        counters.count(Warned(0, text))
    assert counters.warnings == ["first", "second", "third", "3 times: first"]


def test_different_warnings_are_so_many_at_most_and_so_long() -> None:
    counters = Counters(TOPICS)
    for number in range(MOST_WARNINGS + 7):
        counters.warn(f"{number} {'x' * 10_000}")
    assert len(counters.warnings) == MOST_WARNINGS + 1
    assert counters.warnings[-1] == "7 more warnings"
    assert max(map(len, counters.warnings)) == MOST_TEXT


def test_the_newest_changes_of_state_are_kept() -> None:
    counters = Counters(TOPICS)
    for number in range(MOST_CHANGES + 3):
        counters.count(StateChanged(0, State.LOST, f"reason {number}"))
    assert [change["reason"] for change in counters.status_changes] == [
        f"reason {n}" for n in range(3, MOST_CHANGES + 3)
    ]


def test_a_change_of_state_is_told_with_its_reason_and_category() -> None:
    counters = Counters(TOPICS)
    counters.count(StateChanged(1_500_000_000, State.LOST, "walls are gone", FailureCategory.MAP_CONTRADICTED))
    assert counters.status_changes == [
        {"stamp": 1.5, "state": "LOST", "reason": "walls are gone", "failure_category": "map_contradicted"}
    ]
