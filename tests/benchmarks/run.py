"""Accuracy and speed on the real recordings of ../shared/data and on simulated drives, as a table.

    python tests/benchmarks/run.py [--only NAME ...] [--write]

Each replay runs in a process of its own, with session.rrd and map. Simulated recordings are made once, into
build/benchmarks; --write appends the figures to RESULTS.md.
"""

import argparse
import json
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from wayfi.recordings.simulation.recorder import simulate
from wayfi.recordings.simulation.worlds import World
from wayfi.service.evaluate import evaluate

ROOT = Path(__file__).resolve().parents[2]
REAL, MADE, RESULTS = (
    ROOT.parent / "shared" / "data",
    ROOT / "build" / "benchmarks",
    Path(__file__).with_name("RESULTS.md"),
)
WITHOUT_LASER = ("--set", "lidar.enabled=false")
SHOWN_STAGES = 5


@dataclass(frozen=True, slots=True)
class Case:
    """A replay to measure: the folder with recording.mcap and truth.tum, and options of `wayfi replay`.

    One that is `taught` starts with the calibration that another recording has left.
    """

    name: str
    folder: Path
    options: tuple[str, ...] = ()
    world: World | None = None
    taught: Path | None = None


CASES = [
    Case("b14test1", REAL / "b14test1"),
    Case("b24test2", REAL / "b24test2"),
    Case("b3test2", REAL / "b3test2"),
    Case("b24test2, calibrated on b14test1", REAL / "b24test2", taught=REAL / "b14test1"),
    Case("b3test2, calibrated on b14test1", REAL / "b3test2", taught=REAL / "b14test1"),
    Case("flat_calib3", REAL / "flat_calib3"),
    Case("intel", REAL / "intel"),
    Case("intel_wifi (its WiFi is simulated)", REAL / "intel_wifi"),
    Case("intel_wifi (its WiFi is simulated), laser off", REAL / "intel_wifi", WITHOUT_LASER),
    Case("simulated car park", MADE / "carpark", world=World.CARPARK),
    Case("simulated car park, laser off", MADE / "carpark", WITHOUT_LASER, World.CARPARK),
    Case("simulated office", MADE / "office", world=World.OFFICE),
    Case("simulated office, laser off", MADE / "office", WITHOUT_LASER, World.OFFICE),
    Case("simulated warehouse", MADE / "warehouse", world=World.WAREHOUSE),
    Case("simulated warehouse, laser off", MADE / "warehouse", WITHOUT_LASER, World.WAREHOUSE),
]


@dataclass(frozen=True, slots=True)
class Measured:
    """What came out of a case: the report of the replay, its evaluation, and the size of its log."""

    case: Case
    report: dict[str, Any]
    scores: dict[str, Any]
    rrd_mb: float

    @property
    def wall_s(self) -> float:
        """Seconds of the replay, its files included."""
        return float(self.report["wall_s"] + self.report["stages"]["files"]["seconds"])

    def figures(self) -> list[str]:
        """The cells of the table after the name."""
        return [
            f"{self.scores['final']['ate_rmse_m']:.3f}",
            f"{self.scores['online']['ate_rmse_m']:.3f}",
            *(closures(self.scores["closures"][kind]) for kind in ("wifi", "lidar")),
            f"{self.report['recording_s'] / self.wall_s:.0f}",
            f"{self.report['peak_memory_mb']:.0f}",
            f"{self.rrd_mb:.0f}",
            stage_shares(self.report["stages"], self.wall_s),
        ]


COLUMNS = [
    *("recording", "final ATE, m", "online ATE, m", "WiFi closures", "LiDAR closures"),
    *("times real time", "peak MB", ".rrd MB", "stages, % of wall time"),
]


def closures(score: dict[str, Any]) -> str:
    """Accepted closures, precision and NEES."""
    if not score["accepted"]:
        return "0"
    figures = [
        f"{name} {score[key]:.2f}" for name, key in (("p", "precision"), ("NEES", "nees")) if score[key] is not None
    ]
    return ", ".join([str(score["accepted"]), *figures])


def stage_shares(stages: dict[str, Any], wall_s: float) -> str:
    """The stages that take longest; `process` is what is in none of the others inside it."""
    seconds = {name: stage["seconds"] for name, stage in stages.items()}
    inside = ("scan_points", "scan_matching", "backend", "wifi", "closure")
    seconds["process"] -= sum(seconds.get(name, 0.0) for name in inside)
    longest = sorted(seconds.items(), key=lambda item: -item[1])[:SHOWN_STAGES]
    return ", ".join(f"{name} {100 * s / wall_s:.0f}" for name, s in longest)


def make(case: Case) -> None:
    """Simulate the recording of a case, if it is a simulated one and has none yet."""
    if case.world is not None and not case.folder.exists():
        unfinished = case.folder.with_suffix(".part")
        simulate(case.world, unfinished)
        unfinished.rename(case.folder)


def measure(case: Case) -> Measured:
    """Replay a case in a process of its own, and score it."""
    make(case)
    with tempfile.TemporaryDirectory() as made:
        options, out = list(case.options), Path(made) / "out"
        if case.taught:
            replay(case.taught, Path(made) / "before")
            options += ["--calibration", str(Path(made) / "before" / "calibration.toml")]
        report = replay(case.folder, out, *options)
        scores = evaluate(out, case.folder / "truth.tum").to_dict()
        return Measured(case, report, scores, (out / "session.rrd").stat().st_size / 1e6)


def replay(folder: Path, out: Path, *options: str) -> dict[str, Any]:
    """Replay a folder's recording into `out`; the report."""
    command = [sys.executable, "-m", "wayfi.service.cli", "replay", str(folder / "recording.mcap"), "--out", str(out)]
    done = subprocess.run([*command, "--json", *options], capture_output=True, text=True, check=False)
    if done.returncode:
        sys.exit(f"{folder}: {done.stderr.strip()}")
    report: dict[str, Any] = json.loads(done.stdout)
    return report


def row(cells: list[str]) -> str:
    """One row of a Markdown table."""
    return f"| {' | '.join(cells)} |"


def commit() -> str:
    """The commit that is measured, with a + where files differ from it."""
    git = ["git", "-C", str(ROOT), "describe", "--always", "--dirty=+", "--abbrev=7"]
    return subprocess.run(git, capture_output=True, text=True, check=False).stdout.strip() or "unknown"


def result_rows(measured: Measured) -> Iterator[str]:
    """The lines of RESULTS.md for one case: date, commit, recording, figure, how."""
    how = "wayfi replay, defaults" + (f", {' '.join(measured.case.options)}" if measured.case.options else "")
    head = [f"{datetime.now(UTC):%Y-%m-%d}", commit(), measured.case.name]
    for name, value in zip(COLUMNS[1:], measured.figures(), strict=True):
        yield row([*head, f"{name}: {value}", how])


def chosen(only: list[str]) -> Iterator[Case]:
    """The cases whose name has one of `only` in it, or all; without the real ones where they are not here."""
    for case in CASES:
        if only and not any(word in case.name for word in only):
            continue
        if case.world is None and not case.folder.is_dir():
            sys.stderr.write(f"{case.name}: left out, there is no {case.folder}\n")
            continue
        yield case


def say(line: str) -> None:
    """Show a line at once."""
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


def main() -> None:
    """Measure, print, and write where that is asked for."""
    parser = argparse.ArgumentParser(description="Accuracy and speed on real and simulated recordings.")
    parser.add_argument("--only", nargs="*", default=[], help="parts of names of recordings")
    parser.add_argument("--write", action="store_true", help="append the figures to RESULTS.md")
    arguments = parser.parse_args()
    say(row(COLUMNS))
    say(row(["---"] * len(COLUMNS)))
    for case in chosen(arguments.only):
        measured = measure(case)
        say(row([case.name, *measured.figures()]))
        if arguments.write:
            with RESULTS.open("a") as results:
                results.writelines(f"{line}\n" for line in result_rows(measured))


if __name__ == "__main__":
    main()
