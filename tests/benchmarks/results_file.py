"""RESULTS.md: its newest figures, one row a recording, the table beside the peers, and the history below them."""

import subprocess
import sys
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

import peers
from cases import CASES, ROOT
from figures import COLUMNS, median_title

RESULTS = Path(__file__).with_name("RESULTS.md")
NEWEST, PEERS, LOCALISATION = (
    "newest figures",
    "beside the peers",
    "localisation",
)  # sections between <!-- name --> and <!-- end of name -->
MEASURED = "measured"


def row(cells: Sequence[str]) -> str:
    """One row of a Markdown table."""
    return f"| {' | '.join(cells)} |"


def table(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A Markdown table."""
    return "\n".join(map(row, [columns, ["---"] * len(columns), *rows]))


def say(line: str) -> None:
    """Show a line at once."""
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


def commit() -> str:
    """The commit that is measured, with a + where files differ from it."""
    git = ["git", "-C", str(ROOT), "describe", "--always", "--dirty=+", "--abbrev=7"]
    return subprocess.run(git, capture_output=True, text=True, check=False).stdout.strip() or "unknown"


def renew_section(name: str, columns: Sequence[str], rows: Sequence[list[str]], commit: str) -> None:
    """Put rows into the table of a section, in the place of those of the same name, or behind the others."""
    text = RESULTS.read_text()
    kept = {cells[0]: cells for cells in _cells_of(_section(text, name))[2:]}
    kept |= {cells[0]: [*cells, _when(commit)] for cells in rows}
    RESULTS.write_text(_replaced(text, name, table([*columns, MEASURED], list(kept.values()))))


def renew(rows: Sequence[list[str]], commit: str) -> None:
    """Put rows of `COLUMNS` in the place of those of the same recordings, and renew the table beside the peers."""
    text = RESULTS.read_text()
    columns = [*COLUMNS, MEASURED]
    newest = {cells[0]: cells for cells in _cells_of(_section(text, NEWEST))[2:]}
    newest |= {cells[0]: [*cells, _when(commit)] for cells in rows}
    ordered = sorted(newest.values(), key=lambda cells: _place(cells[0]))
    named = {cells[0]: dict(zip(columns, cells, strict=True)) for cells in ordered}
    text = _replaced(text, NEWEST, table(columns, ordered))
    RESULTS.write_text(_replaced(text, PEERS, table(peers.COLUMNS, peers.beside(named))))


def _when(commit: str) -> str:
    return f"{datetime.now(UTC):%Y-%m-%d} {commit}"


def _place(title: str) -> int:
    """Where a row belongs: in the cases' order, a median after its seeds."""
    places = {case.title: 2 * number for number, case in enumerate(CASES)}
    places |= {median_title(case.name): 2 * number + 1 for number, case in enumerate(CASES)}
    return places.get(title, 2 * len(CASES))


def _cells_of(section: str) -> list[list[str]]:
    """The cells of each line of a table."""
    return [[cell.strip() for cell in line.strip().strip("|").split("|")] for line in section.strip().splitlines()]


def _section(text: str, name: str) -> str:
    return text.split(f"<!-- {name} -->")[1].split(f"<!-- end of {name} -->")[0]


def _replaced(text: str, name: str, section: str) -> str:
    return text.replace(_section(text, name), f"\n{section}\n")
