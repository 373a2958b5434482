"""Boxes: the BSSIDs of one radio. Their addresses share most of their octets, and their levels agree everywhere."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.pose2 import Floats
from wayfi.frontends.radio.survey import Survey

EQUAL_OCTETS = 4  # of six, the first without its local bit: makers count up in the last, and set the local bit
MIN_COMMON = 5  # places: fewer say little of whether levels agree
AGREEMENT_DB = 3.5  # standard deviation of the difference: two readings that fade by 2.5 dB
CORRELATION = 0.6  # of the levels at common places: what does not change agrees with anything
LEAST_SHARED = 0.5  # of the places at which the less heard one is heard


@dataclass(frozen=True, slots=True, eq=False)
class Box:
    """The BSSIDs of one radio, the one that is heard most first; their mean level as that one's.

    `level` (p,) dBm at the survey's places, NaN where it was not heard; `readings` (p,) are behind it, and `share` (p,)
    is the share of the visits in which it was heard.
    """

    bssids: tuple[str, ...]
    level: Floats
    readings: Floats
    share: Floats
    strongest_dbm: float


def boxes(heard: Survey) -> list[Box]:
    """The boxes of a survey, those heard most first. Each BSSID is in one."""
    octets = _octets(heard.bssids)
    founders: list[int] = []
    members: list[list[int]] = []
    for k in np.argsort(-heard.heard.sum(axis=0), kind="stable").tolist():
        alike = np.flatnonzero((octets[np.array(founders, np.int64)] == octets[k]).sum(axis=1) >= EQUAL_OCTETS)
        home = next((b for b in alike if _agree(heard, founders[b], k)), None)
        if home is None:
            founders.append(k)
            members.append([k])
        else:
            members[home].append(k)
    return [_box(heard, numbers) for numbers in members]


def _octets(bssids: tuple[str, ...]) -> NDArray[np.int64]:
    """(a, 6) octets, without the bit that says that an address is made up locally."""
    octets = np.array([[int(octet, 16) for octet in bssid.split(":")] for bssid in bssids], np.int64).reshape(-1, 6)
    octets[:, 0] &= ~0x02
    return octets


def _agree(heard: Survey, a: int, b: int) -> bool:
    """Whether the levels of two access points are those of one radio, but for a constant."""
    both = ~np.isnan(heard.level[:, a]) & ~np.isnan(heard.level[:, b])
    fewer = min(np.count_nonzero(heard.heard[:, k]) for k in (a, b))
    if np.count_nonzero(both) < max(MIN_COMMON, LEAST_SHARED * fewer):
        return False
    levels = heard.level[both][:, [a, b]].astype(np.float64)
    if np.std(levels[:, 0] - levels[:, 1]) > AGREEMENT_DB or np.any(np.ptp(levels, axis=0) == 0.0):
        return False
    return float(np.asarray(np.corrcoef(levels.T))[0, 1]) > CORRELATION


def _box(heard: Survey, numbers: list[int]) -> Box:
    level = heard.level[:, numbers].astype(np.float64)
    count = heard.heard[:, numbers].astype(np.float64)
    for k in range(1, len(numbers)):
        both = ~np.isnan(level[:, 0]) & ~np.isnan(level[:, k])
        level[:, k] -= np.median(level[both, k] - level[both, 0])
    readings = count.sum(axis=1)
    mean = np.where(readings > 0, np.nansum(level * count, axis=1) / np.maximum(readings, 1), np.nan)
    share = np.minimum(1.0, count.max(axis=1) / heard.visits)
    return Box(tuple(heard.bssids[k] for k in numbers), mean, readings, share, float(heard.strongest[numbers].max()))
