"""The book of verdicts: every loop candidate has one, and it may change."""

from dataclasses import replace

from wayfi.frontends.events import ClosureJudged, Verdict


class Verdicts:
    """Candidates 0, 1, ... as judged last."""

    def __init__(self) -> None:
        self._judged: list[ClosureJudged] = []

    def __len__(self) -> int:
        return len(self._judged)

    def __getitem__(self, number: int) -> ClosureJudged:
        return self._judged[number]

    def enter(self, judged: ClosureJudged) -> ClosureJudged:
        """A new candidate, which gets the next number; returns it with that."""
        numbered = replace(judged, closure=len(self._judged))
        self._judged.append(numbered)
        return numbered

    def change(self, number: int, verdict: Verdict, reason: str) -> ClosureJudged:
        """Candidate `number` with another verdict."""
        return self.restate(replace(self._judged[number], verdict=verdict, reason=reason))

    def restate(self, judged: ClosureJudged) -> ClosureJudged:
        """A candidate as it is judged now, in the place of what was said of the same number."""
        self._judged[judged.closure] = judged
        return judged
