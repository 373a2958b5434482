"""Accuracy and speed on the real recordings of ../shared/data and on simulated drives, as a table.

    python tests/benchmarks/run.py [--only NAME ...] [--write]

Each replay runs in a process of its own, with session.rrd and map. Simulated recordings are made once, into
build/benchmarks; --write appends the figures to RESULTS.md.
"""

import argparse
import json
import resource
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple

from wayfi.frontends.events import ClosureKind
from wayfi.recordings.files.tables import ClosureRow
from wayfi.recordings.simulation.recorder import simulate
from wayfi.recordings.simulation.robots.models import Robot
from wayfi.recordings.simulation.worlds import World
from wayfi.service.evaluation.evaluate import Evaluation, TrajectoryScore, evaluate

ROOT = Path(__file__).resolve().parents[2]
REAL, MADE, RESULTS = (
    ROOT.parent / "shared" / "data",
    ROOT / "build" / "benchmarks",
    Path(__file__).with_name("RESULTS.md"),
)
WITHOUT_LASER = ("--set", "lidar.enabled=false")
WITHOUT_WIFI = ("--set", "wifi.enabled=false")
SHOWN_STAGES = 5


class Drive(NamedTuple):
    """A simulated drive: where, which robot, and the seed."""

    world: World
    robot: Robot
    seed: int


@dataclass(frozen=True, slots=True)
class Case:
    """A replay to measure: the folder with recording.mcap and truth.tum, and options of `wayfi replay`.

    One that is `taught` starts with the calibration that another recording has left.
    """

    name: str
    folder: Path
    options: tuple[str, ...] = ()
    drive: Drive | None = None
    taught: Path | None = None


def simulated(world: World, robot: Robot, seed: int, without: str = "", options: tuple[str, ...] = ()) -> Case:
    """A case of a whole simulated drive, `without` a sensor."""
    name = ", ".join(part for part in (f"simulated {world}", robot, f"seed {seed}", without) if part)
    return Case(name, MADE / f"{world}_{robot}_{seed}", options, Drive(world, robot, seed))


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
    *(simulated(world, robot, 0) for robot in Robot for world in World),
    *(simulated(world, Robot.TYPICAL, seed) for seed in (1, 2) for world in World),
    *(simulated(world, Robot.TYPICAL, 0, "laser off", WITHOUT_LASER) for world in World if world is not World.CAMPUS),
    simulated(World.CAMPUS, Robot.TYPICAL, 0, "WiFi off", WITHOUT_WIFI),
]


@dataclass(frozen=True, slots=True)
class Measured:
    """What came out of a case: the replay's report and evaluation, its CPU seconds, and the size of its log."""

    case: Case
    report: dict[str, Any]
    evaluation: Evaluation
    cpu_s: float
    rrd_mb: float

    @property
    def wall_s(self) -> float:
        """Seconds of the replay, its files included."""
        return float(self.report["wall_s"] + self.report["stages"]["files"]["seconds"])

    def figures(self) -> list[str]:
        """The cells of the table after the name."""
        scores, stages = self.evaluation.to_dict(), self.report["stages"]
        return [
            f"{scores['final']['ate_rmse_m']:.3f}",
            f"{scores['online']['ate_rmse_m']:.3f}",
            relations(self.evaluation.final),
            *(closures(scores["closures"][kind]) for kind in ("wifi", "lidar")),
            checks(self.evaluation.rows),
            check_ms(stages),
            f"{self.cpu_s:.1f}",
            f"{self.report['recording_s'] / self.wall_s:.0f}",
            f"{stages['process']['last_tenth_ms'] / stages['process']['first_tenth_ms']:.2f}",
            f"{self.report['peak_memory_mb']:.0f}",
            f"{self.rrd_mb:.0f}",
            stage_shares(stages, self.wall_s),
        ]


COLUMNS = [
    *("recording", "final ATE, m", "online ATE, m", "relations, all / on scans, m", "WiFi closures", "LiDAR closures"),
    *("checks", "check ms, p50 / p99 / max", "CPU s", "times real time", "last tenth / first tenth"),
    *("peak MB", ".rrd MB", "stages, % of wall time"),
]


def relations(final: TrajectoryScore) -> str:
    """The mean translation error of the hand-checked relations, over all and where both ends are on scans."""
    if final.relations is None or final.relations_on_scan is None:
        return ""
    errors = (final.relations, final.relations_on_scan)
    return " / ".join(f"{error.translation_mean_m:.3f}" if error.scored else "none" for error in errors)


def checks(rows: list[ClosureRow]) -> str:
    """How many checks by the laser there were, by their verdict at the end."""
    counts = Counter(row.verdict.value for row in rows if row.kind is ClosureKind.LIDAR)
    return ", ".join(f"{verdict} {n}" for verdict, n in sorted(counts.items()))


def check_ms(stages: dict[str, dict[str, float]]) -> str:
    """What a check by the laser took."""
    if "check" not in stages:
        return ""
    return " / ".join(f"{stages['check'][name]:.1f}" for name in ("p50_ms", "p99_ms", "max_ms"))


def closures(score: dict[str, Any]) -> str:
    """Accepted closures, precision and NEES."""
    if not score["accepted"]:
        return "0"
    figures = [
        f"{name} {score[key]:.2f}" for name, key in (("p", "precision"), ("NEES", "nees")) if score[key] is not None
    ]
    return ", ".join([str(score["accepted"]), *figures])


def stage_shares(stages: dict[str, Any], wall_s: float) -> str:
    """The stages that take longest, each without the stages inside it."""
    seconds = {name: stage["seconds"] for name, stage in stages.items()}
    inside = ("scan_points", "scan_matching", "backend", "wifi", "closure")
    seconds["process"] -= sum(seconds.get(name, 0.0) for name in inside)
    if "check" in seconds:
        seconds["closure"] -= seconds["check"]
    longest = sorted(seconds.items(), key=lambda item: -item[1])[:SHOWN_STAGES]
    return ", ".join(f"{name} {100 * s / wall_s:.0f}" for name, s in longest)


def make(case: Case) -> None:
    """Simulate the recording of a case, if it is a simulated one and has none yet."""
    if case.drive is not None and not case.folder.exists():
        unfinished = case.folder.with_suffix(".part")
        simulate(case.drive.world, unfinished, case.drive.seed, robot=case.drive.robot)
        unfinished.rename(case.folder)


def measure(case: Case) -> Measured:
    """Replay a case in a process of its own, and score it."""
    make(case)
    with tempfile.TemporaryDirectory() as made:
        options, out = list(case.options), Path(made) / "out"
        if case.taught:
            replay(case.taught, Path(made) / "before")
            options += ["--calibration", str(Path(made) / "before" / "calibration.toml")]
        before_s = children_cpu_s()
        report = replay(case.folder, out, *options)
        cpu_s = children_cpu_s() - before_s
        relations_path = case.folder / "relations.txt"
        evaluation = evaluate(out, case.folder / "truth.tum", relations_path if relations_path.exists() else None)
        return Measured(case, report, evaluation, cpu_s, (out / "session.rrd").stat().st_size / 1e6)


def children_cpu_s() -> float:
    """CPU seconds of the processes that have ended under this one, theirs included."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


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
        if value:
            yield row([*head, f"{name}: {value}", how])


def chosen(only: list[str]) -> Iterator[Case]:
    """The cases whose name has one of `only` in it, or all; without the real ones where they are not here."""
    for case in CASES:
        if only and not any(word in case.name for word in only):
            continue
        if case.drive is None and not case.folder.is_dir():
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
