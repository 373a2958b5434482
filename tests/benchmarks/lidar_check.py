"""What one bounded check of a loop candidate costs, in ms of CPU time on one thread, as a table.

    python tests/benchmarks/lidar_check.py [--only NAME ...] [--write]

Each recording is replayed, and every check that its candidates ask for is kept: a scan, and the scans of the submap.
Then each is done again in an ellipse of 3 m and 0.3 rad, around a guess that is off as that ellipse says. Of three
rounds over all of them the cheapest counts, for other work may share the machine. --write appends to RESULTS.md.
"""

import argparse
import math
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from cases import Case, chosen, make
from results_file import RESULTS, commit, row, say

from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.closures import lidar_closer
from wayfi.frontends.closures.closure_config import ClosureConfig
from wayfi.frontends.closures.lidar_check import CheckResult, Expected, check
from wayfi.frontends.lidar.lidar_config import LidarConfig
from wayfi.frontends.scan_points import ScanPoints
from wayfi.service.config import load_config
from wayfi.service.replay.replay import ReplayOptions, replay

HALF_AXES = np.array([3.0, 3.0, 0.3])  # m, m, rad
ROUNDS = 3
RECORDINGS = ["car park", "office", "warehouse", "intel"]
COLUMNS = [
    *("recording", "checks", "ms, median", "ms, 99 %", "ms, max"),
    *("points of a scan, mean", "points of a submap, mean", "verdicts"),
]
HOW = "python tests/benchmarks/lidar_check.py"


@dataclass(frozen=True, slots=True, eq=False)
class Asked:
    """What a check was asked during the replay."""

    scan: ScanPoints
    submap_scans: list[ScanPoints]
    submap_poses: Floats
    expected: Expected
    closure: ClosureConfig
    lidar: LidarConfig

    def answer(self, expected: Expected) -> CheckResult | None:
        """Check the candidate where it is `expected`."""
        return check(self.scan, self.submap_scans, self.submap_poses, expected, self.closure, self.lidar)

    def wider(self, rng: np.random.Generator) -> Expected:
        """The candidate in the ellipse of `HALF_AXES`; the guess is drawn from its covariance, inside of it."""
        reach = math.sqrt(self.closure.gate_chi2)
        off = np.full(3, np.inf)
        while np.linalg.norm(off) > reach:
            off = rng.standard_normal(3)
        sigmas = HALF_AXES / reach
        return Expected(Pose2.of(self.expected.T_a_b.array() + off * sigmas), np.diag(sigmas**2))


def asked_in(case: Case) -> list[Asked]:
    """Every check of a replay that had a submap to search."""
    kept: list[Asked] = []

    def keep(*question: object) -> CheckResult | None:
        asked = Asked(*question)
        done = asked.answer(asked.expected)
        if done is not None:
            kept.append(asked)
        return done

    lidar_closer.check = keep
    with tempfile.TemporaryDirectory() as out:
        replay(case.folder / "recording.mcap", load_config((), case.options), None, ReplayOptions(Path(out), rrd=False))
    return kept


def figures(asked: list[Asked]) -> Iterator[str]:
    """The cells of the table after the name."""
    rng = np.random.default_rng(0)
    expected = [a.wider(rng) for a in asked]
    rounds = []
    for _ in range(ROUNDS):
        seconds, done = zip(*map(timed, asked, expected), strict=True)
        rounds.append([np.median(seconds), np.quantile(seconds, 0.99), max(seconds)])
    yield f"{len(asked)}"
    yield from (f"{1e3 * s:.1f}" for s in np.min(rounds, axis=0))
    yield f"{np.mean([len(a.scan.points) for a in asked]):.0f}"
    yield f"{np.mean([len(d.submap) for d in done]):.0f}"
    yield ", ".join(f"{verdict} {n}" for verdict, n in Counter(map(verdict_of, done)).most_common())


def timed(asked: Asked, expected: Expected) -> tuple[float, CheckResult]:
    """CPU seconds of a check, and what it found."""
    start = time.thread_time()
    done = asked.answer(expected)
    return time.thread_time() - start, done


def verdict_of(done: CheckResult) -> str:
    """Accepted or refused."""
    return "refused" if done.refused else "accepted"


def main() -> None:
    """Measure, print, and write where that is asked for."""
    parser = argparse.ArgumentParser(description="The cost of one bounded check, in an ellipse of 3 m and 0.3 rad.")
    parser.add_argument("--only", nargs="*", default=RECORDINGS, help="parts of names")
    parser.add_argument("--write", action="store_true", help="append the figures to RESULTS.md")
    arguments = parser.parse_args()
    say(row(COLUMNS))
    say(row(["---"] * len(COLUMNS)))
    for case in chosen(arguments.only):
        if case.options:
            continue
        make(case)
        cells = list(figures(asked_in(case)))
        say(row([case.name, *cells]))
        if arguments.write:
            figure = ", ".join(f"{name} {cell}" for name, cell in zip(COLUMNS[1:], cells, strict=True))
            head = [f"{datetime.now(UTC):%Y-%m-%d}", commit(), f"one check, {case.name}"]
            with RESULTS.open("a") as results:
                results.write(row([*head, figure, HOW]) + "\n")


if __name__ == "__main__":
    main()
