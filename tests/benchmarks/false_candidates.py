"""How many false WiFi candidates does the estimate bear? Injected among the true ones, without the laser, as a table.

    python tests/benchmarks/false_candidates.py [--only NAME ...] [--seeds N] [--write]

For every candidate that passed the cross-check so many false ones are added that they are the given share of all: at
the same moment, as similar, between its later place and one drawn from the path before it, over 6 m away by the
reference. A cell is the final ATE in m: the median over the seeds and, in brackets, the worst. --write appends to
RESULTS.md.
"""

import argparse
import statistics
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path

import numpy as np
from cases import Case, chosen, make
from results_file import RESULTS, commit, row, say

from wayfi.frontends import slam
from wayfi.frontends.measurements import LaserScan, Measurement
from wayfi.frontends.pipeline import Pipeline
from wayfi.frontends.wifi.fingerprints import WifiCandidate
from wayfi.frontends.wifi.receivers import ReceiverOffset
from wayfi.frontends.wifi.wifi_config import WifiConfig
from wayfi.frontends.wifi.wifi_frontend import WifiFrontend
from wayfi.recordings.files.tum import read_tum
from wayfi.recordings.mcap.recording import open_recording
from wayfi.recordings.ros.codec import decode
from wayfi.recordings.ros.messages import DEFAULT_TOPICS
from wayfi.recordings.ros.topics import Encoding
from wayfi.recordings.trajectory import Trajectory
from wayfi.service.config import load_config
from wayfi.service.evaluation.trajectory_scores import absolute_error

SHARES = (0.0, 0.1, 0.3, 0.5, 0.7, 0.9)
FALSE_M = 6.0
RECORDINGS = ["b14test1", "b24test2", "b3test2", "car park, laser off"]
HOW = "python tests/benchmarks/false_candidates.py, median (worst) over the seeds"
SENSORS = {topic: sensor for sensor, topic in DEFAULT_TOPICS.items()}


@dataclass(frozen=True, slots=True)
class Trial:
    """A recording without its laser, the share of false candidates, and the seed they are drawn with."""

    case: Case
    share: float
    seed: int


class DeceivedWifi(WifiFrontend):
    """WiFi that proposes false candidates among the true ones."""

    def __init__(self, config: WifiConfig, receivers: Mapping[str, ReceiverOffset], trial: Trial) -> None:
        super().__init__(config, receivers)
        self._rng = np.random.default_rng(trial.seed)
        self._false_for_true = trial.share / (1 - trial.share)
        self._truth = read_tum(trial.case.folder / "truth.tum")
        self._owed = 0.0

    def released(self, at_end: bool = False) -> list[WifiCandidate]:
        """What is released, and false ones in its wake."""
        candidates = []
        for candidate in super().released(at_end):
            candidates.append(candidate)
            self._owed += self._false_for_true * candidate.mutual
            while self._owed >= 1:
                self._owed -= 1
                candidates += self._false(candidate)
        return candidates

    def _false(self, true: WifiCandidate) -> list[WifiCandidate]:
        before = [f for f in self.fingerprints if true.b.path_m - f.path_m >= self._config.min_path_m]
        places = self._truth.at(np.array([f.stamp_ns for f in [true.b, *before]]))[:, :2]
        far = np.flatnonzero(np.hypot(*(places[1:] - places[0]).T) > FALSE_M)
        return [replace(true, a=before[int(self._rng.choice(far))])] if len(far) else []


def measurements(folder: Path) -> list[Measurement]:
    """What was recorded, without the laser's scans."""
    records = (record for record in open_recording(folder / "recording.mcap") if record.topic in SENSORS)
    decoded = (decode(record.data, SENSORS[record.topic], Encoding(record.encoding)) for record in records)
    return [m for m in decoded if not isinstance(m, LaserScan)]


def final_ate_m(trial: Trial) -> float:
    """Run the pipeline over a deceived drive."""
    slam.WifiFrontend = partial(DeceivedWifi, trial=trial)
    pipeline = Pipeline(load_config((), ("lidar.enabled=false",)))
    for measurement in measurements(trial.case.folder):
        pipeline.process(measurement)
    result, _ = pipeline.finish()
    truth = read_tum(trial.case.folder / "truth.tum")
    return absolute_error(Trajectory(result.stamps_ns, result.final), truth).error.ate_rmse_m


def main() -> None:
    """Measure, print, and write where that is asked for."""
    parser = argparse.ArgumentParser(description="Final ATE with false WiFi candidates injected.")
    parser.add_argument("--only", nargs="*", default=RECORDINGS, help="parts of names")
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--write", action="store_true", help="append the figures to RESULTS.md")
    arguments = parser.parse_args()
    columns = ["recording, laser off", *(f"{share:.0%} false" for share in SHARES)]
    say(row(columns))
    say(row(["---"] * len(columns)))
    with ProcessPoolExecutor() as pool:
        for case in chosen(arguments.only):
            if case.taught:
                continue
            make(case)
            trials = [Trial(case, share, seed) for share in SHARES for seed in range(arguments.seeds)]
            ates = np.array(list(pool.map(final_ate_m, trials))).reshape(len(SHARES), -1)
            cells = [f"{statistics.median(found):.2f} ({max(found):.2f})" for found in ates]
            say(row([case.name, *cells]))
            if arguments.write:
                figure = "final ATE, m: " + ", ".join(map(": ".join, zip(columns[1:], cells, strict=True)))
                with RESULTS.open("a") as results:
                    results.write(row([f"{datetime.now(UTC):%Y-%m-%d}", commit(), case.name, figure, HOW]) + "\n")


if __name__ == "__main__":
    main()
