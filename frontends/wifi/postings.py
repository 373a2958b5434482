"""An inverted index: finds the fingerprints that have most in common with one, at a bounded cost.

A posting list holds the numbers of the fingerprints that heard one access point within one step of RSSI. However long a
drive becomes, only the newest `MOST_OF_LIST` postings of a list are read, and no further lists after `ENOUGH` postings:
where a building is driven again and again, the newest passes stand for the older ones. The lists rank candidates to a
step of RSSI; `FingerprintIndex` computes their similarity.
"""

import heapq
import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from wayfi.frontends.wifi.readings import LOWEST_DBM

Ints = NDArray[np.int32]

STEPS_APART = 2  # of RSSI, one sigma each: RSSI further apart adds less than exp(-2) to a similarity
MOST_OF_LIST = 4096  # postings: every fingerprint of 2 km of path
ENOUGH = 100_000  # postings: half a millisecond, so that a search takes 1 to 3 ms among 100,000 fingerprints
BLOCK = 32  # postings: an access point is heard over some ten metres; a last block half empty wastes 64 bytes


@dataclass(frozen=True, slots=True, eq=False)
class Overlap:
    """(m,) `numbers` of the fingerprints that have most in common with one, rising.

    `postings_read` is the number of postings read, by which the tests hold the bound of the cost.
    """

    numbers: NDArray[np.int64]
    postings_read: int


class _Chains(NamedTuple):
    """Posting lists as linked blocks: `newest` (access points, steps) is the first, `older` (blocks,) the next.

    -1 stands for no block. `blocks` (blocks, BLOCK) holds fingerprint numbers, of which `filled` (blocks,) are in use.
    """

    newest: Ints
    blocks: Ints
    filled: Ints
    older: Ints


class Postings:
    """A list for each access point and each step of `sigma_db`; fingerprints are added in rising order."""

    def __init__(self, sigma_db: float) -> None:
        self._sigma_db = sigma_db
        steps = math.ceil(-LOWEST_DBM / sigma_db) + 1
        self._chains = _Chains(
            np.full((256, steps), -1, np.int32), np.zeros((1024, BLOCK), np.int32), *np.zeros((2, 1024), np.int32)
        )
        self._used = 0
        self._common = np.zeros(1024)

    def add(self, number: int, aps: Ints, rssi: NDArray[np.float32]) -> None:
        """Add fingerprint `number` to the lists of the `aps` (n,) that it heard at `rssi` (n,) dBm."""
        self._reserve(aps)
        if number >= len(self._common):
            self._common = np.zeros(2 * number)
        self._used = _append(number, aps, self._steps(rssi), self._chains, self._used)

    def overlap(
        self, aps: Ints, rssi: NDArray[np.float32], weights: NDArray[np.float64], before: int, most: int
    ) -> Overlap:
        """The `most` fingerprints below `before` with most in common with one that heard `aps` (n,) at `rssi` (n,) dBm.

        An access point counts by its weight of `weights` (n,); of equals the earlier is returned. `aps` come in falling
        order of importance: the last are left out once `ENOUGH` postings of the first were read.
        """
        self._reserve(aps)
        return Overlap(*_overlap(aps, self._steps(rssi), weights, before, most, self._chains, self._common))

    def _steps(self, rssi: NDArray[np.float32]) -> NDArray[np.int64]:
        steps: NDArray[np.int64] = ((rssi - LOWEST_DBM) / self._sigma_db).astype(np.int64)
        return np.clip(steps, 0, self._chains.newest.shape[1] - 1)

    def _reserve(self, aps: Ints) -> None:
        newest, blocks, filled, older = self._chains
        highest = int(aps.max(initial=-1))
        if highest >= len(newest):
            newest = np.vstack([newest, np.full((highest, newest.shape[1]), -1, np.int32)])
        if self._used + len(aps) > len(blocks):
            more = len(blocks) + len(aps)
            blocks = np.vstack([blocks, np.zeros((more, BLOCK), np.int32)])
            filled, older = (np.concatenate([old, np.zeros(more, np.int32)]) for old in (filled, older))
        self._chains = _Chains(newest, blocks, filled, older)


@njit(cache=True)
def _append(number: int, aps: Ints, steps: NDArray[np.int64], chains: _Chains, used: int) -> int:
    newest, blocks, filled, older = chains
    for i in range(aps.shape[0]):
        block = newest[aps[i], steps[i]]
        if block < 0 or filled[block] == BLOCK:
            older[used], filled[used] = block, 0
            block = used
            newest[aps[i], steps[i]] = block
            used += 1
        blocks[block, filled[block]] = number
        filled[block] += 1
    return used


@njit(cache=True)
def _overlap(
    aps: Ints,
    steps: NDArray[np.int64],
    weights: NDArray[np.float64],
    before: int,
    most: int,
    chains: _Chains,
    common: NDArray[np.float64],
) -> tuple[NDArray[np.int64], int]:
    """The numbers, and the postings read; `common` (fingerprints,) is all zeros before and after."""
    met, read = _sum_common(aps, steps, weights, before, chains, common)
    best = [(0.0, 0) for _ in range(0)]
    for number in met:
        entry = (common[number], -number)
        common[number] = 0.0
        if len(best) < most:
            heapq.heappush(best, entry)
        elif entry > best[0]:
            heapq.heapreplace(best, entry)
    return np.sort(np.array([-number for _, number in best], np.int64)), read


@njit(cache=True)
def _sum_common(
    aps: Ints,
    steps: NDArray[np.int64],
    weights: NDArray[np.float64],
    before: int,
    chains: _Chains,
    common: NDArray[np.float64],
) -> tuple[Ints, int]:
    """Add to `common` what each fingerprint has in common; returns these fingerprints, and the postings read."""
    newest, blocks, filled, older = chains
    met = np.empty(ENOUGH + (2 * STEPS_APART + 1) * MOST_OF_LIST, np.int32)
    count, read = 0, 0
    for i in range(aps.shape[0]):
        if read > ENOUGH:
            break
        for step in range(max(0, steps[i] - STEPS_APART), min(newest.shape[1], steps[i] + STEPS_APART + 1)):
            shared = weights[i] * math.exp(-0.5 * (step - steps[i]) ** 2)
            block, left = newest[aps[i], step], MOST_OF_LIST
            while block >= 0 and left > 0:
                for k in range(filled[block] - 1, max(-1, filled[block] - 1 - left), -1):
                    number = blocks[block, k]
                    read += 1
                    if number < before:
                        if common[number] == 0.0:
                            met[count] = number
                            count += 1
                        common[number] += shared
                left -= filled[block]
                block = older[block]
    return met[:count], read
