"""The paper's tables with the figures of all three."""

import csv
from pathlib import Path

import pytest

from wayfi.service.reproduction import paper_figures
from wayfi.service.reproduction.methods import Method, Stage
from wayfi.service.reproduction.sweep_figures import SweepFigures
from wayfi.service.reproduction.tables import (
    Row,
    Table,
    figure_text,
    method_table,
    stage_table,
    sweep_table,
    write_tables,
)


def three_tables() -> list[Table]:
    figures = {value: SweepFigures(value, 0.125 * value, None, 1 / 3, 2.5) for value in paper_figures.WINDOWS}
    streaming = SweepFigures(7, 0.5, 0.25, None, 0.75)
    seconds = {Stage.WIFI_CLOSURES: 1.5, Stage.FIRST_OPTIMISATION: 0.25, Stage.TWO_FIFTHS: 9.0}
    return [
        sweep_table("w", paper_figures.WINDOWS, figures, 80, streaming),
        method_table({Method.ODOMETRY: 50.0, Method.WIFI: 2.0, Method.TWO_FIFTHS: 1.0}, 0.6, 0.03),
        stage_table(seconds, 4.0, 100.0),
    ]


@pytest.mark.parametrize("number", range(3))
def test_a_csv_holds_every_figure_in_full(tmp_path: Path, number: int) -> None:
    table = three_tables()[number]
    write_tables(tmp_path, [table])
    with (tmp_path / table.file).open(newline="") as file:
        head, *rows = csv.reader(file)
    assert head == table.columns
    read = [Row(*row[:2], *(float(figure) if figure else None for figure in row[2:])) for row in rows]
    assert read == table.rows


def test_the_streaming_service_stands_beside_what_it_is_compared_with() -> None:
    sweep, methods, stages = three_tables()
    beside = {(row.quantity, row.setting): row.streaming for row in sweep.rows if row.streaming is not None}
    assert {setting for _, setting in beside} == {"80"}
    assert beside["closures", "80"] == 7
    assert {row.setting: row.streaming for row in methods.rows if row.streaming is not None} == {
        Method.WIFI: 0.6,
        Method.TWO_FIFTHS: 0.03,
    }
    assert [row.streaming for row in stages.rows] == [None, None, None, 4.0]


def test_the_times_together_are_of_the_stages_that_the_paper_times() -> None:
    together = three_tables()[2].rows[-1]
    assert together.reproduction == 1.5 + 0.25
    assert together.paper == pytest.approx(364.0 + 2.76)


@pytest.mark.parametrize(
    ("value", "text"),
    [(None, ""), (0.0, "0"), (0.0123456, "0.0123"), (2.7, "2.7"), (54.66, "54.7"), (3888.4, "3888"), (396, "396")],
)
def test_a_figure_has_three_digits_or_all_before_the_point(value: float | None, text: str) -> None:
    assert figure_text(value) == text
