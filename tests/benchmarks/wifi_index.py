"""What one more fingerprint costs when 1,000, 10,000 and 100,000 are stored, and what the bounded search misses.

    python tests/benchmarks/wifi_index.py [--write]

A robot drives one lap of 420 m again and again in two simulated buildings: path loss, shadowing, fading.
Milliseconds of CPU are of storing a fingerprint, learning the weights of the access points from it, and finding the
most similar ones that are 30 m of path or more before it; against the exhaustive search for the same. --write appends
to RESULTS.md.
"""

import argparse
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from results_file import RESULTS, commit, row, say

from wayfi.frontends.wifi.access_points import AccessPoints
from wayfi.frontends.wifi.fingerprint_index import FingerprintIndex
from wayfi.frontends.wifi.readings import Readings
from wayfi.frontends.wifi.wifi_config import AccessPointConfig

Floats = NDArray[np.float64]

STORED = (1_000, 10_000, 100_000)
MEASURED = 300  # fingerprints of each size, of which every fifth is searched for exhaustively as well
FINGERPRINT_M, GRID_M = 0.5, 0.25
SEPARATE = 60  # fingerprints: 30 m of path
SIGMA_DB = 6.0
EXPONENT, SHADOWING_DB, SHADOWING_M, FEATURES = 3.5, 5.0, 6.0, 32
FADING_DB, LOWEST_DBM, HEARD_SHARE = 3.0, -90.0, 0.93
HOW = "python tests/benchmarks/wifi_index.py"


@dataclass(frozen=True, slots=True)
class Building:
    """150 x 80 m with so many access points, of -30 dBm at a metre less what walls take (dB)."""

    name: str
    aps: int
    walls_db: tuple[float, float]


BUILDINGS = (Building("1,000 access points", 1000, (12.0, 42.0)), Building("300, strong", 300, (-6.0, 6.0)))
COLUMNS = [
    *("building", "heard", "stored", "ms, median", "ms, 99 %", "exhaustive ms", "best found", "of its similarity"),
    *("best within 2 m", "exhaustive within 2 m", "MB"),
]


def lap() -> Floats:
    """(n, 2) m: three lanes of 140 m, there, back and there again, every `GRID_M`."""
    xs = np.arange(5.0, 145.0, GRID_M)
    return np.vstack([np.column_stack([xs[:: (-1) ** i], np.full(len(xs), 20.0 * i + 20.0)]) for i in range(3)])


def mean_rssi(building: Building, places: Floats, rng: np.random.Generator) -> Floats:
    """(n, aps) dBm at `places` (n, 2), without fading."""
    where = rng.uniform((0.0, 0.0), (150.0, 80.0), (building.aps, 2))
    power = -30.0 - rng.uniform(*building.walls_db, building.aps)
    mean = np.empty((len(places), building.aps))
    for ap in range(building.aps):
        distance = np.maximum(np.hypot(*(places - where[ap]).T), 1.5)
        waves = rng.standard_normal((2, FEATURES)) / SHADOWING_M
        phases = rng.uniform(0.0, 2 * np.pi, FEATURES)
        shadow = SHADOWING_DB * np.sqrt(2 / FEATURES) * np.cos(places @ waves + phases).sum(axis=1)
        mean[:, ap] = power[ap] - 10 * EXPONENT * np.log10(distance) + shadow
    return mean


def fingerprints(building: Building, places: Floats) -> Iterator[tuple[Floats, Readings]]:
    """What is heard at each half metre of an endless drive, and where that is."""
    rng = np.random.default_rng(0)
    mean = mean_rssi(building, places, rng)
    bssids = [f"02:00:00:00:{ap >> 8:02x}:{ap & 255:02x}" for ap in range(building.aps)]
    number = 0
    while True:
        along_m = number * FINGERPRINT_M + rng.normal(0.0, 0.3)
        grid = round(along_m / GRID_M) % len(places)
        rssi = mean[grid] + rng.normal(0.0, FADING_DB, building.aps)
        heard = np.flatnonzero((rssi > LOWEST_DBM) & (rng.random(building.aps) < HEARD_SHARE))
        rssi = np.clip(rssi[heard], LOWEST_DBM, 0.0).astype(np.float32)
        yield places[grid], Readings(tuple(bssids[ap] for ap in heard), rssi, np.zeros(len(heard), np.float32))
        number += 1


class Drive:
    """An index that is driven into, and the true places of its fingerprints."""

    def __init__(self, building: Building) -> None:
        self._heard = fingerprints(building, lap())
        self.index = FingerprintIndex(SIGMA_DB)
        self._access_points = AccessPoints(self.index, AccessPointConfig())
        self.places: list[Floats] = []
        for _ in range(3):
            self.go_on()()
        self.index.similar(2, 2)  # compiles, which takes memory as well
        self._empty_mb = memory_mb()

    def go_on(self) -> Callable[[], int]:
        """The robot has heard a fingerprint; returns what stores it and learns from it, and tells its number."""
        place, readings = next(self._heard)
        self.places.append(place)

        def add() -> int:
            number = self.index.add(readings)
            self._access_points.learn(number * FINGERPRINT_M)
            return number

        return add

    def memory_mb(self) -> float:
        """What the index has taken so far."""
        return memory_mb() - self._empty_mb

    def within_2_m(self, a: int, b: int) -> bool:
        """Whether two fingerprints truly are of one place."""
        return bool(np.hypot(*(self.places[a] - self.places[b])) < 2.0)


def memory_mb() -> float:
    """The memory of this process."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096 / 1e6


def measure(building: Building) -> Iterator[list[str]]:
    """The rows of the table for one building."""
    drive = Drive(building)
    for stored in STORED:
        while drive.index.size < stored:
            drive.go_on()()
        drive.index.similar(stored - 1, stored - SEPARATE)
        mb = drive.memory_mb()
        yield [building.name, *figures(drive), f"{mb:.0f}"]


def figures(drive: Drive) -> list[str]:
    """Add `MEASURED` more fingerprints, and search for each."""
    stored, heard = drive.index.size, []
    seconds, exhaustive_s, found, share, near, exhaustive_near = [], [], [], [], [], []
    for k in range(MEASURED):
        add = drive.go_on()
        start = time.thread_time()
        b = add()
        similar = drive.index.similar(b, b - SEPARATE)
        seconds.append(time.thread_time() - start)
        heard.append(len(drive.index.heard(b).aps))
        if k % 5:
            continue
        start = time.thread_time()
        to_all = drive.index.similarities(np.array([b]), np.arange(b - SEPARATE))[0]
        exhaustive_s.append(time.thread_time() - start)
        best = int(np.argmax(to_all))
        found.append(best in similar.numbers[:1])
        share.append(similar.similarity[0] / to_all[best])
        near.append(drive.within_2_m(int(similar.numbers[0]), b))
        exhaustive_near.append(drive.within_2_m(best, b))
    return [
        *(f"{np.mean(heard):.0f}", f"{stored:,}"),
        *(f"{1e3 * s:.2f}" for s in (*np.quantile(seconds, (0.5, 0.99)), np.median(exhaustive_s))),
        *(f"{np.mean(found):.2f}", f"{np.mean(share):.3f}", f"{np.mean(near):.2f}", f"{np.mean(exhaustive_near):.2f}"),
    ]


def main() -> None:
    """Measure, print, and write where that is asked for."""
    parser = argparse.ArgumentParser(description="The cost of one more fingerprint, and what the search misses.")
    parser.add_argument("--write", action="store_true", help="append the figures to RESULTS.md")
    arguments = parser.parse_args()
    say(row(COLUMNS))
    say(row(["---"] * len(COLUMNS)))
    for building in BUILDINGS:
        for cells in measure(building):
            say(row(cells))
            if arguments.write:
                figure = ", ".join(f"{name} {cell}" for name, cell in zip(COLUMNS[1:], cells[1:], strict=True))
                head = [f"{datetime.now(UTC):%Y-%m-%d}", commit(), f"WiFi index, {building.name}"]
                with RESULTS.open("a") as results:
                    results.write(row([*head, figure, HOW]) + "\n")


if __name__ == "__main__":
    main()
