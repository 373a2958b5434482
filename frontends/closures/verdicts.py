"""The latest verdict on every loop candidate."""

from dataclasses import replace

from wayfi.frontends.events import ClosureJudged, Verdict


class Verdicts:
    """Candidates 0, 1, ..., each with its latest verdict."""

    def __init__(self) -> None:
        self._judged: list[ClosureJudged] = []

    def __len__(self) -> int:
        return len(self._judged)

    def __getitem__(self, number: int) -> ClosureJudged:
        return self._judged[number]

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
