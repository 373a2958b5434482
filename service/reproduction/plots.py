"""Plots of a reproduction: the trajectories, and the paper's tables as curves and bars."""

import io
import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from wayfi.backend.pose2 import Floats
from wayfi.recordings.files.atomic_files import write_bytes
from wayfi.recordings.trajectory import Trajectory
from wayfi.service.evaluation.trajectory_scores import absolute_error
from wayfi.service.reproduction.tables import COLUMNS, SWEPT, Table, figure_text

_COLORS = dict(zip(COLUMNS, ("#8a94a0", "#1f6fd0", "#2e9e5b"), strict=True))
_LABELS = {
    "paper": "paper, in its own car park",
    "reproduction": "reproduction, on this recording",
    "streaming": "streaming service, on this recording",
}
_SETTINGS = {"w": "w, fingerprints in a window", "k": "k, most similar fingerprints"}
_INK, _GRID, _TRUTH = "#17202b", "#e6e9ed", "#8a94a0"
_MARGIN = 0.1  # of the reference's extent
_WIDTH_INCHES, _HIGHEST_INCHES, _TITLE_INCHES, _LEGEND_INCHES = 12.8, 6.5, 0.6, 0.4


def write_plots(
    directory: Path, sweeps: list[Table], methods: Table, stages: Table, trajectories: Mapping[str, Trajectory],
    truth: Trajectory,
) -> None:  # fmt: skip
    """Write trajectories.png, closures.png, methods.png and time.png into `directory`. Raises OSError."""
    write_bytes(directory / "trajectories.png", _png(_trajectory_figure(trajectories, truth)))
    write_bytes(directory / "closures.png", _png(_sweep_figure(sweeps)))
    write_bytes(directory / "methods.png", _png(_bar_figure(methods)))
    write_bytes(directory / "time.png", _png(_bar_figure(stages)))


def _trajectory_figure(trajectories: Mapping[str, Trajectory], truth: Trajectory) -> Figure:
    """A panel for each trajectory, aligned to the reference."""
    low, high = _view(truth.poses[:, :2])
    width, height = high - low
    columns = 2 if height < 0.5 * width else 4
    rows = math.ceil(len(trajectories) / columns)
    panel_inches = min(_WIDTH_INCHES / columns * float(height / width), _HIGHEST_INCHES) + _TITLE_INCHES
    figure = _figure((_WIDTH_INCHES, panel_inches * rows + _LEGEND_INCHES))
    for place, (name, trajectory) in enumerate(trajectories.items(), 1):
        axes = figure.add_subplot(rows, columns, place)
        alignment = absolute_error(trajectory, truth)
        aligned = alignment.T_reference_estimate.transform(trajectory.poses[:, :2])
        axes.plot(*truth.poses[:, :2].T, color=_TRUTH, linewidth=3.0, alpha=0.5, label="reference")
        axes.plot(*aligned.T, color=_COLORS["reproduction"], linewidth=0.9, label="estimate, aligned; metres")
        _decorate(axes, f"{name}\nATE {figure_text(alignment.error.ate_rmse_m)} m")
        axes.set_aspect("equal")
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    _legend(figure)
    return figure


def _view(points: Floats) -> tuple[Floats, Floats]:
    """The lower left and upper right corner (2,) of the panels: the reference's extent and a margin."""
    low, high = points.min(axis=0), points.max(axis=0)
    margin = max(_MARGIN * float((high - low).max()), 1.0)
    return low - margin, high + margin


def _sweep_figure(tables: list[Table]) -> Figure:
    """A row of panels for each table, with a panel for each quantity except time, over w or k."""
    quantities = [quantity for quantity in SWEPT.values() if quantity != SWEPT["seconds"]]
    figure = _figure((_WIDTH_INCHES, 2.8 * len(tables) + _LEGEND_INCHES))
    for row_of_axes, table in zip(figure.subplots(len(tables), len(quantities), squeeze=False), tables, strict=True):
        for axes, quantity in zip(row_of_axes, quantities, strict=True):
            _draw_sweep(axes, table, quantity)
    _legend(figure)
    return figure


def _draw_sweep(axes: Axes, table: Table, quantity: str) -> None:
    rows = [row for row in table.rows if row.quantity == quantity]
    settings = [int(row.setting) for row in rows]
    for column in COLUMNS:
        values = np.array([getattr(row, column) for row in rows], float)
        axes.plot(settings, values, "o-", color=_COLORS[column], linewidth=1.4, markersize=4, label=_LABELS[column])
    _decorate(axes, quantity)
    axes.set_xticks(settings)
    axes.set_xlabel(_SETTINGS[table.setting], fontsize=8, color=_INK)
    axes.margins(y=0.15)
    axes.set_ylim(bottom=0.0)


def _bar_figure(table: Table) -> Figure:
    """A group of bars for each row, with a bar for each column, on a logarithmic scale."""
    figure = _figure((10.0, 1.3 + 0.62 * len(table.rows)))
    axes = figure.add_subplot()
    for offset, column in enumerate(COLUMNS):
        figures = [getattr(row, column) for row in table.rows]
        places = np.arange(len(figures)) + 0.27 * (offset - 1)
        lengths = np.nan_to_num(np.array(figures, float))
        bars = axes.barh(places, lengths, height=0.25, color=_COLORS[column], label=_LABELS[column])
        axes.bar_label(bars, [f" {figure_text(value)}" for value in figures], fontsize=8, color=_INK)
    axes.set_yticks(range(len(table.rows)), [row.setting for row in table.rows])
    axes.invert_yaxis()
    axes.set_xscale("log")
    axes.set_xlabel(f"{table.rows[0].quantity} (logarithmic)", fontsize=8, color=_INK)
    _decorate(axes, table.title)
    axes.margins(x=0.12)
    _legend(figure)
    return figure


def _figure(size_inches: tuple[float, float]) -> Figure:
    figure = Figure(figsize=size_inches, layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def _decorate(axes: Axes, title: str) -> None:
    axes.set_title(title, fontsize=9, color=_INK)
    axes.grid(color=_GRID, linewidth=0.8)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    axes.tick_params(colors=_INK, labelsize=8)


def _legend(figure: Figure) -> None:
    handles, labels = figure.axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper left", ncols=len(labels), frameon=False, fontsize=9)


def _png(figure: Figure) -> bytes:
    picture = io.BytesIO()
    figure.savefig(picture, format="png", dpi=110, metadata={"Software": None})
    return picture.getvalue()
