"""The paper's Tables I to IV with the figures of the paper, the reproduction and the streaming service."""

from dataclasses import asdict, dataclass
from pathlib import Path

from wayfi.recordings.files.atomic_files import write_csv
from wayfi.service.reproduction import paper_figures
from wayfi.service.reproduction.methods import Method, Stage
from wayfi.service.reproduction.sweep_figures import SweepFigures

COLUMNS = ["paper", "reproduction", "streaming"]

SWEPT = {
    "closures": "closures",
    "position_m": "position error of a closure, m",
    "orientation_rad": "orientation error of a closure, rad",
    "seconds": "time, s",
    "ate_m": "ATE of WiFi SLAM, m",
}
"""The quantities of Tables I and II, by the field of SweepFigures."""


@dataclass(frozen=True, slots=True)
class Row:
    """One quantity for one setting, method or stage; None for a missing figure."""

    quantity: str
    setting: str
    paper: float | None
    reproduction: float | None
    streaming: float | None

    @property
    def figures(self) -> tuple[float | None, float | None, float | None]:
        """The figures of the three columns."""
        return self.paper, self.reproduction, self.streaming


@dataclass(frozen=True, slots=True)
class Table:
    """One of the paper's tables; `setting` is the title of its row labels, `file` the name of its CSV."""

    title: str
    file: str
    setting: str
    rows: list[Row]

    @property
    def columns(self) -> list[str]:
        """The column titles."""
        return ["quantity", self.setting, *COLUMNS]

    def rows_as_text(self) -> list[list[str]]:
        """The rows as text: a quantity only in its first row, an empty string for a missing figure."""
        texts, quantity = [], ""
        for row in self.rows:
            named = "" if row.quantity == quantity else row.quantity
            texts.append([named, row.setting, *map(figure_text, row.figures)])
            quantity = row.quantity
        return texts


def figure_text(value: float | None) -> str:
    """Three significant digits, or all digits before the point; empty for None."""
    if value is None:
        return ""
    return f"{value:.0f}" if abs(value) >= 100 else f"{value:.3g}"


def sweep_table(
    letter: str, paper: dict[int, SweepFigures], ours: dict[int, SweepFigures], chosen: int, streaming: SweepFigures
) -> Table:
    """Table I (`letter` w) or II (k). The streaming service, which has neither, is in the rows of `chosen`."""
    number, other = ("I", "k = 2") if letter == "w" else ("II", "w = 80")
    rows = []
    for name, quantity in SWEPT.items():
        for value, figures in ours.items():
            service = streaming if value == chosen else SweepFigures()
            rows.append(
                Row(quantity, str(value), *(getattr(column, name) for column in (paper[value], figures, service)))
            )
    title = f"Table {number}: WiFi closures by {letter}, {other} (streaming: laser off)"
    return Table(title, f"table_{number}_{letter}.csv", letter, rows)


def method_table(ours: dict[Method, float], laser_off: float, laser_on: float | None) -> Table:
    """Table III: the ATE of each method; the streaming service with the laser off, and with the laser on."""
    streaming = {Method.WIFI: laser_off, Method.TWO_FIFTHS: laser_on}
    rows = [
        Row("ATE, m", method, paper_figures.ATE_M[method], ours.get(method), streaming.get(method))
        for method in Method
        if method in ours or method is Method.GMAPPING
    ]
    note = "laser off" if laser_on is None else "laser off in the rows of WiFi, laser on in the last"
    return Table(f"Table III: ATE by method (streaming: {note})", "table_III_methods.csv", "method", rows)


def stage_table(ours: dict[Stage, float], streaming_s: float, drive_s: float) -> Table:
    """Table IV: the time of each stage, and their sum, compared with the streaming service."""
    rows = [
        Row("time, s", stage, paper_figures.SECONDS.get(stage), ours[stage], None) for stage in Stage if stage in ours
    ]
    timed = [stage for stage in ours if stage in paper_figures.SECONDS]
    paper_s, ours_s = (sum(column[stage] for stage in timed) for column in (paper_figures.SECONDS, ours))
    together = "together" if len(timed) == len(ours) else "together, without 40 %"
    rows.append(Row("time, s", together, paper_s, ours_s, streaming_s))
    title = f"Table IV: time by stage; the paper's drive took {paper_figures.DRIVE_S:.0f} s, this one {drive_s:.0f} s"
    return Table(title, "table_IV_time.csv", "stage", rows)


def write_tables(directory: Path, tables: list[Table]) -> None:
    """Write each table as CSV into `directory`, with unrounded figures. Raises OSError."""
    for table in tables:
        write_csv(directory / table.file, table.columns, (asdict(row).values() for row in table.rows))
