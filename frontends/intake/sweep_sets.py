"""The sweeps of several lasers, taken together: each set holds one of every laser, as near in time as they come."""

from dataclasses import dataclass

from wayfi.frontends.measurements import PAUSE_NS, Sweep
from wayfi.frontends.odometry.driven_path import PathPoint

TOO_OLD = 0.75  # of a laser's own interval: its next sweep is nearer; at a half, two lasers in turns would never meet


@dataclass(frozen=True, slots=True, eq=False)
class SweepSet:
    """Sweeps of different lasers, each at its place on the path, in the order of their stamps."""

    members: tuple[tuple[PathPoint, Sweep], ...]

    @property
    def point(self) -> PathPoint:
        """The place of the newest."""
        return self.members[-1][0]

    @property
    def newest(self) -> Sweep:
        """The newest sweep."""
        return self.members[-1][1]


@dataclass(slots=True)
class _Heard:
    stamp_ns: int
    interval_ns: int = 0


class SweepSets:
    """Collects sweeps until every laser that was heard within a second has sent one; that of a lone laser is a set."""

    def __init__(self) -> None:
        self._heard: dict[str, _Heard] = {}
        self._waiting: dict[str, tuple[PathPoint, Sweep]] = {}

    def add(self, laser: str, point: PathPoint, sweep: Sweep) -> list[SweepSet]:
        """Add the next sweep of `laser`, at `point`; returns the sets that are complete by it."""
        self._hear(laser, point.stamp_ns)
        out = self._complete() if laser in self._waiting else []  # another laser is slower, or has fallen silent
        self._waiting = {
            name: (at, waiting) for name, (at, waiting) in self._waiting.items() if not self._is_old(name, at, point)
        }
        self._waiting[laser] = point, sweep
        return out + (self._complete() if self._waiting.keys() >= self._heard.keys() else [])

    def _hear(self, laser: str, stamp_ns: int) -> None:
        before = self._heard.get(laser)
        self._heard[laser] = _Heard(stamp_ns, stamp_ns - before.stamp_ns if before else 0)
        self._heard = {name: h for name, h in self._heard.items() if stamp_ns - h.stamp_ns <= PAUSE_NS}

    def _is_old(self, name: str, at: PathPoint, now: PathPoint) -> bool:
        heard, age_ns = self._heard.get(name), now.stamp_ns - at.stamp_ns
        return heard is None or at.discontinuities != now.discontinuities or 0 < TOO_OLD * heard.interval_ns < age_ns

    def _complete(self) -> list[SweepSet]:
        members = sorted(self._waiting.values(), key=lambda member: member[0].stamp_ns)
        self._waiting = {}
        return [SweepSet(tuple(members))]
