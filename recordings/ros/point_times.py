"""The time of each point of a cloud in seconds after its stamp, from any unit and origin that drivers use."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

UNITS_S = (1.0, 1e-3, 1e-6, 1e-9)
SLOWEST_SWEEP_S = 1.0  # 3D LiDARs turn at 5 Hz and more; a longer span of times is in a smaller unit
LARGEST_OFFSET_S = 1.0  # from a cloud's stamp to its first point; larger offsets mean another clock


def seconds_after_stamp(times: NDArray[Any], stamp_ns: int) -> NDArray[np.float32] | None:
    """(n,) float32 seconds after `stamp_ns` of the driver's `times` (n,); None if all times are equal or not finite.

    The unit is the largest of s, ms, us and ns for which the sweep lasts at most a second; this is unambiguous for
    sweeps of at least 1 ms. Times may count from the stamp or from the epoch; times of another clock are shifted so
    that the first is at the stamp. A non-finite time is set to the first.
    """
    finite = np.isfinite(times)
    if not finite.any():
        return None
    first, last = times[finite].min(), times[finite].max()
    span = float(last) - float(first)
    unit_s = next((unit for unit in UNITS_S if span * unit <= SLOWEST_SWEEP_S), None)
    if unit_s is None or span == 0.0:
        return None
    elapsed = np.where(finite, times - first, 0).astype(np.float64) * unit_s
    return (elapsed + _first_s(float(first) * unit_s, stamp_ns)).astype(np.float32)


def _first_s(first_s: float, stamp_ns: int) -> float:
    """Seconds from the stamp to the first point, whose time counts from the stamp, the epoch or another clock."""
    for offset_s in (first_s, first_s - stamp_ns * 1e-9):
        if abs(offset_s) <= LARGEST_OFFSET_S:
            return offset_s
    return 0.0
