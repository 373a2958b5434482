"""What came in, what was dropped and why, and what a person should know: the counts behind report.json."""

from collections import Counter
from collections.abc import Mapping
from typing import Any

from wayfi.frontends.events import ClosureJudged, Dropped, Event, StateChanged, Warned
from wayfi.frontends.measurements import Sensor

Drops = dict[str, dict[str, int]]


def merged(*drops: Mapping[str, Mapping[str, int]]) -> Drops:
    """Counts by topic and reason, added up."""
    total: dict[str, Counter[str]] = {}
    for by_topic in drops:
        for topic, reasons in by_topic.items():
            total.setdefault(topic, Counter()).update(reasons)
    return {topic: dict(reasons) for topic, reasons in total.items()}


class Tally:
    """Counts by topic, verdicts by candidate, warnings and changes of state, in the order they came."""

    def __init__(self, topics: dict[Sensor, str]) -> None:
        self._topics = topics
        self.messages: Counter[str] = Counter()
        self.dropped: dict[str, Counter[str]] = {}
        self.drops = 0
        self.warnings: list[str] = []
        self.status_changes: list[dict[str, Any]] = []
        self.verdicts: dict[int, ClosureJudged] = {}

    def take(self, event: Event) -> None:
        """Count what an event says."""
        match event:
            case Dropped():
                self.drop(self._topics[event.sensor], event.reason)
            case ClosureJudged():
                self.verdicts[event.closure] = event
            case Warned():
                self.warnings.append(event.text)
            case StateChanged():
                change = {"stamp": event.stamp_ns * 1e-9, "state": event.state.value, "reason": event.reason}
                self.status_changes.append(change)

    def drop_many(self, topic: str, reasons: Mapping[str, int]) -> None:
        """Count messages that never came here."""
        self.dropped.setdefault(topic, Counter()).update(reasons)
        self.drops += sum(reasons.values())

    def drop(self, topic: str, reason: str) -> int:
        """Count a message that was not used; returns how many there are of its kind."""
        counts = self.dropped.setdefault(topic, Counter())
        counts[str(reason)] += 1
        self.drops += 1
        return counts[str(reason)]
