"""How long each stage takes, in bounded memory; the pipeline never reads it."""

import math
import time
from collections import Counter, defaultdict

import numpy as np

BIN = math.log(1.05)  # bins of equal ratio: a percentile is right to 2.5 %
SHORTEST_S = 1e-7
MOST_BLOCKS = 200


class StageTimer:
    """Measures the calls of every stage."""

    def __init__(self) -> None:
        self._stages: defaultdict[str, StageCost] = defaultdict(StageCost)
        self._last: dict[str, float] = {}

    def __call__(self, stage: str) -> "_Timed":
        """Time what runs inside, as one call of `stage`."""
        return _Timed(self, stage)

    def add(self, stage: str, seconds: float) -> None:
        """Add a call of `stage`."""
        self._stages[stage].add(seconds)
        self._last[stage] = seconds

    def pop_durations(self) -> dict[str, float]:
        """The seconds of the last call of every stage that ran since this was last called."""
        self._last, last = {}, self._last
        return last

    def report(self) -> dict[str, dict[str, float]]:
        """For each stage: seconds in all; ms of a call: p50, p99, max, and the means of the first and last tenth."""
        return {stage: cost.summary() for stage, cost in sorted(self._stages.items())}


class _Timed:
    """The context in which one call of a stage runs; a call that raises is not counted."""

    __slots__ = ("_stage", "_start_s", "_timer")

    def __init__(self, timer: StageTimer, stage: str) -> None:
        self._timer, self._stage = timer, stage

    def __enter__(self) -> None:
        self._start_s = time.perf_counter()

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is None:
            self._timer.add(self._stage, time.perf_counter() - self._start_s)


class StageCost:
    """The durations of a stage's calls: their histogram, and their sums along the drive."""

    def __init__(self) -> None:
        self._bins: Counter[int] = Counter()
        self._longest_s = 0.0
        self._along = CostAlong()

    def add(self, seconds: float) -> None:
        """Add a call."""
        self._bins[math.floor(math.log(max(seconds, SHORTEST_S)) / BIN)] += 1
        self._longest_s = max(self._longest_s, seconds)
        self._along.add(seconds)

    def quantile_s(self, share: float) -> float:
        """The duration that `share` (0 to 1) of the calls do not exceed, to 2.5 %; there has to be a call."""
        numbers = sorted(self._bins)
        up_to = np.cumsum([self._bins[number] for number in numbers])
        middle = numbers[int(np.searchsorted(up_to, share * up_to[-1]))] + 0.5
        return min(math.exp(middle * BIN), self._longest_s)

    def summary(self) -> dict[str, float]:
        """Seconds in all; ms of a call: p50, p99, max, means of the first and last tenth. There has to be a call."""
        milliseconds = {
            "p50_ms": self.quantile_s(0.5),
            "p99_ms": self.quantile_s(0.99),
            "max_ms": self._longest_s,
            "first_tenth_ms": self._along.mean_s(0.0, 0.1),
            "last_tenth_ms": self._along.mean_s(0.9, 1.0),
        }
        seconds = round(self._along.total_s, 3)
        return {"seconds": seconds} | {name: round(s * 1e3, 3) for name, s in milliseconds.items()}


class CostAlong:
    """Seconds summed over blocks of equally many calls; when there are `MOST_BLOCKS`, pairs of them become one."""

    def __init__(self) -> None:
        self._calls = 0
        self._block_calls = 1
        self._blocks_s: list[float] = []

    @property
    def total_s(self) -> float:
        """The seconds of all calls."""
        return math.fsum(self._blocks_s)

    def add(self, seconds: float) -> None:
        """Add a call."""
        if self._calls == self._block_calls * MOST_BLOCKS:
            self._blocks_s = [a + b for a, b in zip(self._blocks_s[::2], self._blocks_s[1::2], strict=True)]
            self._block_calls *= 2
        if self._calls == self._block_calls * len(self._blocks_s):
            self._blocks_s.append(0.0)
        self._blocks_s[-1] += seconds
        self._calls += 1

    def mean_s(self, begin: float, end: float) -> float:
        """The mean duration from share `begin` to share `end` of all calls, each taken as long as its block's mean."""
        ends = np.minimum(self._block_calls * np.arange(len(self._blocks_s) + 1), self._calls)
        before, up_to = np.interp(np.array([begin, end]) * self._calls, ends, np.cumsum([0.0, *self._blocks_s]))
        return float(up_to - before) / ((end - begin) * self._calls)
