"""The counts behind report.json: messages, drops by reason, verdicts, warnings and changes of state."""

from collections import Counter, deque
from collections.abc import Mapping
from typing import Any

from wayfi.frontends.events import ClosureJudged, Dropped, Event, FloorChanged, StateChanged, Warned
from wayfi.frontends.measurements import SECOND_NS, Sensor

MOST_TEXT = 500  # characters of a warning
MOST_WARNINGS = 1000  # different ones
MOST_CHANGES = 10_000  # of state, the newest

Drops = dict[str, dict[str, int]]


def merged(*drops: Mapping[str, Mapping[str, int]]) -> Drops:
    """Counts by topic and reason, added up."""
    total: dict[str, Counter[str]] = {}
    for by_topic in drops:
        for topic, reasons in by_topic.items():
            total.setdefault(topic, Counter()).update(reasons)
    return {topic: dict(reasons) for topic, reasons in total.items()}


class Counters:
    """Counts by topic, verdicts by candidate, warnings and changes of state, in order; all bounded but the verdicts."""

    def __init__(self, topics: dict[Sensor, str]) -> None:
        self._topics = topics
        self.messages: Counter[str] = Counter()
        self.dropped: dict[str, Counter[str]] = {}
        self.drops = 0
        self.floor: int | None = 0  # of the map, on which the robot is; None while that is not known
        self._warnings: Counter[str] = Counter()
        self._more_warnings = 0
        self._status_changes: deque[dict[str, Any]] = deque(maxlen=MOST_CHANGES)
        self.verdicts: dict[int, ClosureJudged] = {}

    def count(self, event: Event) -> None:
        """Count an event."""
        match event:
            case Dropped():
                self.drop(event.topic or self._topics[event.sensor], event.reason)
            case ClosureJudged():
                self.verdicts[event.closure] = event
            case Warned():
                self.warn(event.text)
            case StateChanged():
                self._status_changes.append(_change(event))
            case FloorChanged():
                self.floor = event.floor

    @property
    def warnings(self) -> list[str]:
        """The first `MOST_WARNINGS` different warnings in order, then the counts of those that were repeated."""
        texts = [*self._warnings, *(f"{count} times: {text}" for text, count in self._warnings.items() if count > 1)]
        return texts + ([f"{self._more_warnings} more warnings"] if self._more_warnings else [])

    @property
    def status_changes(self) -> list[dict[str, Any]]:
        """The newest `MOST_CHANGES` changes of state: stamp (s), state, reason, failure category."""
        return list(self._status_changes)

    def warn(self, text: str) -> None:
        """Count a warning."""
        text = text[:MOST_TEXT]
        if text in self._warnings or len(self._warnings) < MOST_WARNINGS:
            self._warnings[text] += 1
        else:
            self._more_warnings += 1

    def drop_many(self, topic: str, reasons: Mapping[str, int]) -> None:
        """Count messages that were dropped before they reached the drive, by reason."""
        self.dropped.setdefault(topic, Counter()).update(reasons)
        self.drops += sum(reasons.values())

    def drop(self, topic: str, reason: str) -> None:
        """Count a message that was not used."""
        counts = self.dropped.setdefault(topic, Counter())
        counts[str(reason)] += 1
        self.drops += 1


def _change(event: StateChanged) -> dict[str, Any]:
    return {
        "stamp": event.stamp_ns / SECOND_NS,
        "state": event.state.value,
        "reason": event.reason,
        "failure_category": event.failure_category.value,
    }
