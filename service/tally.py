"""What came in, what was dropped and why, and what a person should know: the counts behind report.json."""

from collections import Counter
from typing import Any

from wayfi.frontends.events import ClosureJudged, Dropped, Event, StateChanged, Warned
from wayfi.frontends.measurements import Sensor


class Tally:
    """Counts by topic, verdicts by candidate, warnings and changes of state, in the order they came."""

    def __init__(self, topics: dict[Sensor, str]) -> None:
        self._topics = topics
        self.messages: Counter[str] = Counter()
        self.dropped: dict[str, Counter[str]] = {}
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

    def drop(self, topic: str, reason: str) -> int:
        """Count a message that was not used; returns how many there are of its kind."""
        counts = self.dropped.setdefault(topic, Counter())
        counts[str(reason)] += 1
        return counts[str(reason)]
