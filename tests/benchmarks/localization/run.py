"""Localisation in known maps, as a table: found how often and how soon, and what was claimed falsely.

    python tests/benchmarks/localization/run.py [--only WORD ...] [--exact NAME ...] [--starts N] [--seed N]
        [--kept DIR] [--json FILE] [--picture NAME ...] [--write]

An experiment has all of --only in its name. Maps and drives are made once, into DIR. Of every run --json gets a line;
--picture draws those with one of NAME in their name (`#3` is the fourth start) into DIR/pictures. --write puts the rows
into RESULTS.md. Maps are never localised in by the recording that made them; truth is for scoring alone.
"""

import argparse
import json
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))
sys.path.insert(0, str(Path(__file__).parents[1]))
from benchmarks.localization.catalogue import Measurable, chosen
from benchmarks.localization.drives import KEPT
from benchmarks.localization.experiments import Result
from benchmarks.localization.figures import COLUMNS, cells
from benchmarks.localization.localizers import localizer
from benchmarks.localization.picture import draw
from results_file import LOCALISATION, commit, renew_section, row, say


def measured(experiment: Measurable, arguments: argparse.Namespace) -> list[str]:
    """Run an experiment; returns its row. Tells of every run as it ends."""
    scores, cpu = [], []
    for result in experiment.results(arguments.kept, localizer, arguments.starts, arguments.seed):
        scores.append(result.score)
        cpu.append((result.run.cpu_s, result.run.longest_ms))
        if arguments.json:
            with arguments.json.open("a") as file:
                file.write(json.dumps(line_of(result)) + "\n")
        if any(name in result.name for name in arguments.picture):
            draw(result, arguments.kept / "pictures" / f"{result.name.replace(' ', '_')}.png")
    return cells(experiment.name, scores, cpu)


def line_of(result: Result) -> dict[str, object]:
    """What is kept of a run."""
    run = result.run
    states = [((c.stamp_ns - run.start_ns) / 1e9, c.state, c.reason) for c in run.changes]
    times = {"start_ns": run.start_ns, "cpu_s": run.cpu_s, "longest_ms": run.longest_ms}
    return {"run": result.name} | result.score.to_dict() | times | {"states": states}


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="*", default=[], help="words that an experiment has in its name")
    parser.add_argument("--exact", nargs="*", default=[], help="names of experiments")
    parser.add_argument("--starts", type=int, default=100, help="of each experiment")
    parser.add_argument("--seed", type=int, default=0, help="of the random starts")
    parser.add_argument("--kept", type=Path, default=KEPT, help="folder for drives and maps")
    parser.add_argument("--json", type=Path, help="file that gets a line for each run")
    parser.add_argument("--picture", nargs="*", default=[], help="parts of names of runs")
    parser.add_argument("--write", action="store_true", help="put the figures into RESULTS.md")
    arguments = parser.parse_args()
    measured_at = commit()
    say(row(COLUMNS))
    say(row(["---"] * len(COLUMNS)))
    for number, experiment in enumerate(chosen(arguments.only, arguments.exact)):
        if not number:  # else the first run would compile, and its longest message would be that
            next(experiment.results(arguments.kept, localizer, 1, arguments.seed + 1), None)
        cells_of_it = measured(experiment, arguments)
        say(row(cells_of_it))
        if arguments.write:
            renew_section(LOCALISATION, COLUMNS, [cells_of_it], measured_at)


if __name__ == "__main__":
    main()
