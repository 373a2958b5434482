"""How long each stage takes: measured beside the pipeline, never read by it."""

import time
from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np


class StageTimer:
    """Seconds of every call of every stage."""

    def __init__(self) -> None:
        self._seconds: defaultdict[str, list[float]] = defaultdict(list)
        self._last: dict[str, float] = {}

    @contextmanager
    def __call__(self, stage: str) -> Iterator[None]:
        """Time what runs inside, as one call of `stage`."""
        start = time.perf_counter()
        yield
        seconds = time.perf_counter() - start
        self._seconds[stage].append(seconds)
        self._last[stage] = seconds

    def take(self) -> dict[str, float]:
        """The seconds of the last call of every stage that ran since this was last asked."""
        self._last, last = {}, self._last
        return last

    def report(self) -> dict[str, dict[str, float]]:
        """For each stage: seconds in all, and the p50, p99 and max of a call in ms."""
        return {stage: _summary(np.array(seconds)) for stage, seconds in sorted(self._seconds.items())}


def _summary(seconds: "np.ndarray[tuple[int], np.dtype[np.float64]]") -> dict[str, float]:
    p50, p99 = np.percentile(seconds, [50, 99]) * 1e3
    return {
        "seconds": round(float(seconds.sum()), 3),
        "p50_ms": round(float(p50), 3),
        "p99_ms": round(float(p99), 3),
        "max_ms": round(float(seconds.max()) * 1e3, 3),
    }
