"""Accuracy and speed on real recordings and on simulated drives, as a table.

    python tests/benchmarks/run.py [--only NAME ...] [--write]

Each replay runs in a process of its own, with session.rrd and map. Of drives that are simulated with several seeds the
median is given as well. --write puts the figures into RESULTS.md, and the maps of `pictured` cases beside it.
"""

import argparse
from itertools import groupby

from cases import chosen
from figures import COLUMNS, cells, median_cells
from measuring import measure
from results_file import commit, renew, row, say


def main() -> None:
    """Measure, print, and write where that is asked for."""
    parser = argparse.ArgumentParser(description="Accuracy and speed on real and simulated recordings.")
    parser.add_argument("--only", nargs="*", default=[], help="parts of names of recordings")
    parser.add_argument("--write", action="store_true", help="put the figures into RESULTS.md")
    arguments = parser.parse_args()
    measured_at = commit()
    say(row(COLUMNS))
    say(row(["---"] * len(COLUMNS)))
    for name, cases in groupby(chosen(arguments.only), lambda case: case.name):
        measured, rows = [], []
        for case in cases:
            measured.append(measure(case, keep_picture=arguments.write))
            rows.append(cells(measured[-1]))
            say(row(rows[-1]))
        if len(measured) > 1:
            rows.append(median_cells(name, measured))
            say(row(rows[-1]))
        if arguments.write:
            renew(rows, measured_at)


if __name__ == "__main__":
    main()
