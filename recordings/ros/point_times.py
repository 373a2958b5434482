"""When each point of a cloud was taken, in seconds after its stamp, whatever unit and origin its driver uses."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

UNITS_S = (1.0, 1e-3, 1e-6, 1e-9)
LONGEST_SWEEP_S = 1.0
LARGEST_OFFSET_S = 1.0  # between a cloud's stamp and its first point; what is more is another clock


def seconds_after_stamp(times: NDArray[Any], stamp_ns: int) -> NDArray[np.float32] | None:
    """(n,) float32 s after `stamp_ns` of `times` (n,) as a driver gives them; None where they say nothing.

    The unit is the largest of s, ms, us and ns in which the sweep lasts a second at most; that is unambiguous for
    sweeps of 1 ms and longer. Times count from the stamp, or from the epoch; those of another clock are taken to begin
    at the stamp. A time that is not finite counts as the first.
    """
    finite = np.isfinite(times)
    if not finite.any():
        return None
    first, last = times[finite].min(), times[finite].max()
    span = float(last) - float(first)
    unit_s = next((unit for unit in UNITS_S if span * unit <= LONGEST_SWEEP_S), None)
    if unit_s is None or span == 0.0:
        return None
    elapsed = np.where(finite, times - first, 0).astype(np.float64) * unit_s
    return (elapsed + _first_s(float(first) * unit_s, stamp_ns)).astype(np.float32)


def _first_s(first_s: float, stamp_ns: int) -> float:
    """Seconds from the stamp to the first point, said by its time since the stamp or since the epoch."""
    for offset_s in (first_s, first_s - stamp_ns * 1e-9):
        if abs(offset_s) <= LARGEST_OFFSET_S:
            return offset_s
    return 0.0
