"""The latest verdict on every loop candidate."""

from collections.abc import Iterable, Iterator
from dataclasses import replace

from wayfi.frontends.events import ClosureJudged, Event, Verdict


class Verdicts:
    """Candidates 0, 1, ..., each with its latest verdict."""

    def __init__(self) -> None:
        self._judged: list[ClosureJudged] = []

    def __len__(self) -> int:
        return len(self._judged)

    def __getitem__(self, number: int) -> ClosureJudged:
        return self._judged[number]

    def __iter__(self) -> Iterator[ClosureJudged]:
        return iter(self._judged)

    def begin_with(self, judged: Iterable[ClosureJudged]) -> None:
        """Begin with the candidates of a map, in the order of their numbers."""
        self._judged.extend(judged)

    def enter(self, judged: ClosureJudged) -> ClosureJudged:
        """Add a new candidate; returns it with the next number as its `closure`."""
        numbered = replace(judged, closure=len(self._judged))
        self._judged.append(numbered)
        return numbered

    def change(self, number: int, verdict: Verdict, reason: str) -> ClosureJudged:
        """Change the verdict on candidate `number`; returns the candidate with it."""
        return self.restate(replace(self._judged[number], verdict=verdict, reason=reason))

    def restate(self, judged: ClosureJudged) -> ClosureJudged:
        """Replace the entry of the same number by `judged`; returns it."""
        self._judged[judged.closure] = judged
        return judged

    def move_stamps(self, stamps_ns: dict[int, int]) -> list[Event]:
        """The verdicts on candidates of keyframes that have other stamps now, stated anew."""
        events: list[Event] = []
        for judged in list(self._judged):
            a, b = judged.keyframe_a, judged.keyframe_b
            if a in stamps_ns or b in stamps_ns:
                a_ns, b_ns = stamps_ns.get(a, judged.stamp_a_ns), stamps_ns.get(b, judged.stamp_b_ns)
                events.append(self.restate(replace(judged, stamp_a_ns=a_ns, stamp_b_ns=b_ns)))
        return events
