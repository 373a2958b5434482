"""Closures that a person has taken out of the graph, until they are restored."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from wayfi.backend.errors import WayfiError
from wayfi.backend.graph.factors import Factor
from wayfi.backend.graph.pose_graph import PoseGraph
from wayfi.frontends.closures.verdicts import Verdicts
from wayfi.frontends.events import ClosureJudged, Verdict

VETOED = "vetoed by command"


class VetoError(WayfiError):
    """A closure that cannot be vetoed or restored."""


@dataclass(frozen=True, slots=True, eq=False)
class VetoedClosure:
    """A closure as it was judged before it was vetoed, and its factors."""

    judged: ClosureJudged
    factors: tuple[Factor, ...]


class FormerClosures:
    """The closures of the map that a drive goes on with, but those that a closer of the drive holds."""

    def __init__(self, factors: Mapping[int, tuple[int, ...]], closures: int) -> None:
        self._factors, self._closures = dict(factors), closures

    def factors(self) -> dict[int, tuple[int, ...]]:
        """The numbers of the factors of each of them."""
        return self._factors

    def release(self, closure: int) -> bool:
        """Give up the factors of a closure that was vetoed; False where it is none of these."""
        return self._factors.pop(closure, None) is not None

    def take_back(self, closure: int, factors: tuple[int, ...]) -> bool:
        """Take a closure of the map back that was restored; False where it is none of these."""
        if closure < self._closures:
            self._factors[closure] = factors
        return closure < self._closures


class Closer(Protocol):
    """Holds the factors of accepted closures of its kind."""

    def factors(self) -> dict[int, tuple[int, ...]]:
        """The numbers of the factors of each accepted closure."""

    def release(self, closure: int) -> bool:
        """Give up the factors of a closure that was vetoed; False where it is none of its own."""

    def take_back(self, closure: int, factors: tuple[int, ...]) -> bool:
        """Take a closure back that was restored, with its factors; False where it is none of its own."""


class Vetoes:
    """Takes closures out of the graph and puts them back; the closers give them up, and judge them no more."""

    def __init__(self, graph: PoseGraph, verdicts: Verdicts, closers: Sequence[Closer]) -> None:
        self._graph, self._verdicts, self._closers = graph, verdicts, list(closers)
        self.kept: dict[int, VetoedClosure] = {}

    def begin_with(self, vetoed: Mapping[int, VetoedClosure], former: Closer) -> None:
        """Begin with what is vetoed of a map, whose other closures `former` holds."""
        self._closers.append(former)
        self.kept.update(vetoed)
        for closure in vetoed:
            self._verdicts.change(closure, Verdict.REMOVED, VETOED)

    def veto(self, closure: int) -> ClosureJudged:
        """Remove the factors of an accepted closure; returns its verdict. Raises VetoError."""
        if closure in self.kept:
            raise VetoError(f"closure {closure} is vetoed already")
        if not 0 <= closure < len(self._verdicts):
            raise VetoError(f"there is no closure {closure}: {len(self._verdicts)} were judged so far")
        judged = self._verdicts[closure]
        for closer in self._closers:
            numbers = closer.factors().get(closure)
            if numbers is not None and closer.release(closure):
                factors = self._graph.factors()
                self.kept[closure] = VetoedClosure(judged, tuple(factors[number] for number in numbers))
                for number in numbers:
                    self._graph.remove(number)
                return self._verdicts.change(closure, Verdict.REMOVED, VETOED)
        why = f"{judged.verdict}: {judged.reason}"
        raise VetoError(f"closure {closure} is not part of the map ({why}): nothing to veto")

    def restore(self, closure: int) -> ClosureJudged:
        """Add the factors of a vetoed closure again; returns its verdict. Raises VetoError."""
        if closure not in self.kept:
            raise VetoError(f"closure {closure} is not vetoed: there is nothing to restore")
        vetoed = self.kept.pop(closure)
        numbers = tuple(self._graph.add(factor) for factor in vetoed.factors)
        if not any(closer.take_back(closure, numbers) for closer in self._closers):
            for number in numbers:
                self._graph.remove(number)
            raise VetoError(f"closure {closure} cannot be restored: the scans that it relates were forgotten")
        return self._verdicts.restate(vetoed.judged)
