"""The clock of a stream: the stamps of its messages against their log times."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wayfi.frontends.measurements import SECOND_NS

Stamps = NDArray[np.int64]
STEP_S = 0.5  # a clock that is set; the latencies of drivers change by less
AROUND = 5  # messages before and after a step, whose medians tell it from one late message
MOST_STEPS = 1000  # that are looked at: more are no steps but disorder
REAL_TIME = 1.2  # a faster or slower playback than this was recorded from another recording


@dataclass(frozen=True, slots=True)
class ClockInspection:
    """Stamps less log times: their median `offset_s`, and `spread_s` from the 5th to the 95th percentile.

    `steps` counts how often the offset changes by over 0.5 s for good, at most by `largest_step_s`. `playback` is how
    many seconds of stamps pass in one of log time, None where that cannot be told: it is about 1 unless the recording
    was made from a playback. `still` where no stamp differs from another. `against_odometry_s` is the offset less that
    of the odometry, None without one.
    """

    offset_s: float
    spread_s: float
    steps: int
    largest_step_s: float
    playback: float | None
    still: bool
    against_odometry_s: float | None = None

    @property
    def in_real_time(self) -> bool:
        """Whether log times passed as the stamps did."""
        return _is_real_time(self.playback)


def clock_of(stamps_ns: Stamps, log_times_ns: Stamps) -> ClockInspection | None:
    """The clock of messages stamped `stamps_ns` (n,), in the order of their `log_times_ns` (n,); None without any."""
    if len(stamps_ns) == 0:
        return None
    # in floating point, since two times may differ by over 2^63 ns
    stamps_s, log_s = ((ns - float(ns[0])) / SECOND_NS for ns in (stamps_ns, log_times_ns))
    playback = _playback(stamps_s, log_s)
    first_s = (int(stamps_ns[0]) - int(log_times_ns[0])) / SECOND_NS
    ahead_s = stamps_s - log_s
    steps = _steps(ahead_s if playback is None or _is_real_time(playback) else stamps_s - playback * log_s)
    low, high = np.percentile(ahead_s, [5, 95])
    return ClockInspection(
        offset_s=first_s + float(np.median(ahead_s)),
        spread_s=float(high - low),
        steps=len(steps),
        largest_step_s=max(steps, key=abs, default=0.0),
        playback=playback,
        still=len(stamps_ns) > 1 and bool(np.all(stamps_ns == stamps_ns[0])),
    )


def _is_real_time(playback: float | None) -> bool:
    return playback is None or 1.0 / REAL_TIME < playback < REAL_TIME


def _playback(stamps_s: NDArray[np.float64], log_s: NDArray[np.float64]) -> float | None:
    """Seconds of stamps in a second of log time: the median over fifths of the stream, which steps do not change."""
    ends = np.linspace(0, len(stamps_s) - 1, 6).astype(int)
    stamped, logged = np.diff(stamps_s[ends]), np.diff(log_s[ends])
    if len(stamps_s) < len(ends) or np.any(logged <= 0.0):
        return None
    rate = float(np.median(stamped / logged))
    return rate if rate > 0.0 else None


def _steps(ahead_s: NDArray[np.float64]) -> list[float]:
    """How far each lasting step of `ahead_s` (n,) goes, s."""
    at = np.flatnonzero(np.abs(np.diff(ahead_s)) > STEP_S)[:MOST_STEPS] + 1
    inner = at[(at >= AROUND) & (at <= len(ahead_s) - AROUND)]
    changes = [float(np.median(ahead_s[i : i + AROUND]) - np.median(ahead_s[i - AROUND : i])) for i in inner]
    return [change for change in changes if abs(change) > STEP_S]
