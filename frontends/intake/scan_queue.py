"""The sweeps that wait for odometry, and when that covers them."""

from collections import deque
from itertools import pairwise

from wayfi.frontends.intake.cloud_intake import cloud_duration_ns
from wayfi.frontends.measurements import PAUSE_NS, SECOND_NS, PointCloud, Sweep
from wayfi.frontends.odometry.driven_path import DrivenPath, PathPoint

MOST_WAITING = 200  # sweeps, to bound memory: 5 s at 40 Hz
MOST_POINTS_WAITING = 20_000_000  # beams and points of these sweeps: some 300 MB
LONGEST_SWEEP_S = 2.0  # lasers turn at 5 Hz and more; a time increment that makes a sweep longer is a fault of units


class ScanQueue:
    """Sweeps in the order they came, each with its stamp on the time base; bounded by number and by points."""

    def __init__(self) -> None:
        self._waiting: deque[tuple[int, Sweep]] = deque()
        self._points = 0

    def add(self, stamp_ns: int, sweep: Sweep) -> list[Sweep]:
        """Add a sweep; removes and returns the oldest ones where there are too many."""
        self._waiting.append((stamp_ns, sweep))
        self._points += _size(sweep)
        dropped = []
        while len(self._waiting) > MOST_WAITING or self._points > max(MOST_POINTS_WAITING, _size(sweep)):
            dropped.append(self._pop()[1])
        return dropped

    @property
    def oldest(self) -> Sweep | None:
        """The sweep that waits longest."""
        return self._waiting[0][1] if self._waiting else None

    def waiting(self) -> list[tuple[int, Sweep]]:
        """The sweeps that wait, oldest first, each with its stamp on the time base."""
        return list(self._waiting)

    def drop_ahead(self, stamp_ns: int) -> list[Sweep]:
        """Remove and return the sweeps stamped after `stamp_ns`: their clock is not the odometry's."""
        ahead = [sweep for sweep_stamp_ns, sweep in self._waiting if sweep_stamp_ns > stamp_ns]
        self._waiting = deque(waiting for waiting in self._waiting if waiting[0] <= stamp_ns)
        self._points -= sum(map(_size, ahead))
        return ahead

    @property
    def waited_ns(self) -> int:
        """From the oldest sweep that waits to the newest; a pause between two of them counts for a second at most."""
        return sum(min(after[0] - before[0], PAUSE_NS) for before, after in pairwise(self._waiting))

    def ready(self, path: DrivenPath) -> list[tuple[PathPoint | None, Sweep]]:
        """Remove and return the sweeps that the path covers, each at its place; None where that is no longer kept."""
        out: list[tuple[PathPoint | None, Sweep]] = []
        latest = path.latest
        while latest and self._waiting and self._waiting[0][0] + sweep_ns(self._waiting[0][1]) <= latest.stamp_ns:
            stamp_ns, sweep = self._pop()
            out.append((path.at(stamp_ns), sweep))
        return out

    def _pop(self) -> tuple[int, Sweep]:
        stamp_ns, sweep = self._waiting.popleft()
        self._points -= _size(sweep)
        return stamp_ns, sweep


def sweep_ns(sweep: Sweep) -> int:
    """How long after its stamp the last beam of a sweep was taken, ns; 0 where that is unknown."""
    if isinstance(sweep, PointCloud):
        return cloud_duration_ns(sweep)
    seconds = sweep.time_increment_s * len(sweep.ranges)
    return int(seconds * SECOND_NS) if 0 < seconds < LONGEST_SWEEP_S else 0


def _size(sweep: Sweep) -> int:
    """The number of beams or points of a sweep."""
    return len(sweep.points if isinstance(sweep, PointCloud) else sweep.ranges)
