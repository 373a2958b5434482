"""Plots of an evaluation: the trajectories over the reference, and their errors over time."""

import io
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from wayfi.backend.pose2 import Floats, Pose2
from wayfi.recordings.files.atomic_files import write_bytes
from wayfi.recordings.files.tables import ClosureRow
from wayfi.recordings.trajectory import Trajectory
from wayfi.service.evaluation.closure_scores import accepted_of, has_reference, is_correct
from wayfi.service.evaluation.evaluate import Evaluation, TrajectoryScore

_TRUTH, _FINAL, _ONLINE = "#8a94a0", "#1f6fd0", "#e08a1e"
_RIGHT, _WRONG, _UNKNOWN = "#2e9e5b", "#d03b3b", "#b8a5d6"
_INK = "#17202b"
_GAP_S = 15.0


def write_plots(directory: Path, evaluation: Evaluation) -> None:
    """Write evaluation_trajectory.png and evaluation_error.png into `directory`. Raises OSError."""
    write_bytes(directory / "evaluation_trajectory.png", _png(_trajectory_figure(evaluation)))
    write_bytes(directory / "evaluation_error.png", _png(_error_figure(evaluation)))


def _trajectory_figure(evaluation: Evaluation) -> Figure:
    """The reference, both trajectories aligned to it, and the accepted closures as lines."""
    figure = _figure(_plot_size(evaluation.truth.poses))
    axes = _axes(figure)
    _draw_closures(axes, evaluation)
    axes.plot(*evaluation.truth.poses[:, :2].T, color=_TRUTH, linewidth=3.0, alpha=0.6, label="reference")
    for name, score, color in (("online", evaluation.online, _ONLINE), ("final", evaluation.final, _FINAL)):
        axes.plot(*_aligned(score).T, color=color, linewidth=1.0, label=_label(name, score))
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel("x (m)")
    axes.set_ylabel("y (m)")
    _legend(figure, axes)
    return figure


def _error_figure(evaluation: Evaluation) -> Figure:
    """The position errors of both trajectories over time."""
    figure = _figure((10.0, 4.0))
    axes = _axes(figure)
    for name, score, color in (("online", evaluation.online, _ONLINE), ("final", evaluation.final, _FINAL)):
        seconds = evaluation.truth.seconds(score.alignment.stamps_ns)
        seconds, errors = _split_at_gaps(seconds, score.alignment.errors_m)
        axes.plot(seconds, errors, color=color, linewidth=1.2, label=_label(name, score))
    axes.set_ylim(bottom=0.0)
    axes.margins(x=0.01)
    axes.set_xlabel("time (s)")
    axes.set_ylabel("position error after alignment (m)")
    _legend(figure, axes)
    return figure


def _draw_closures(axes: Axes, evaluation: Evaluation) -> None:
    """Draw each accepted closure as a line, coloured by whether it is correct."""
    rows, truth = accepted_of(evaluation.rows), evaluation.truth
    correct, known = is_correct(rows, truth), has_reference(rows, truth)
    groups = (
        ("not scored", _UNKNOWN, ~known),
        ("right", _RIGHT, correct),
        ("wrong", _WRONG, known & ~correct),
    )
    for name, color, members in groups:
        if not members.any():
            continue
        lines = _closure_lines([row for row, member in zip(rows, members, strict=True) if member], truth)
        label = f"closures {name}: {len(lines)}"
        axes.add_collection(LineCollection(list(lines), colors=color, linewidths=0.8, alpha=0.7, label=label))
        axes.plot(*lines.reshape(-1, 2).T, "o", color=color, markersize=2.5, alpha=0.7)


def _closure_lines(rows: list[ClosureRow], truth: Trajectory) -> Floats:
    """(n, 2, 2) lines from the reference's position of a to the position of b according to the closure."""
    a = truth.at(np.array([row.stamp_a_ns for row in rows], np.int64))
    ends = [(Pose2.of(pose) @ row.T_a_b).array()[:2] for pose, row in zip(a, rows, strict=True)]
    return np.stack([a[:, :2], np.array(ends)], axis=1)


def _aligned(score: TrajectoryScore) -> Floats:
    return score.alignment.T_reference_estimate.transform(score.trajectory.poses[:, :2])


def _split_at_gaps(seconds: Floats, errors: Floats) -> tuple[Floats, Floats]:
    """The curve with a NaN in every gap, so that no line is drawn across it."""
    gaps = np.flatnonzero(np.diff(seconds) > _GAP_S) + 1
    return np.insert(seconds, gaps, np.nan), np.insert(errors, gaps, np.nan)


def _label(name: str, score: TrajectoryScore) -> str:
    return f"{name}: ATE {score.alignment.error.ate_rmse_m:.2f} m"


def _plot_size(poses: Floats) -> tuple[float, float]:
    """The size in inches: 10 on the longer side of the reference's extent, at least 4 on the other."""
    width, height = np.ptp(poses[:, :2], axis=0) + 1.0
    scale = 10.0 / max(width, height)
    return max(4.0, float(width * scale)), max(4.0, float(height * scale))


def _figure(size_inches: tuple[float, float]) -> Figure:
    figure = Figure(figsize=size_inches, layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def _axes(figure: Figure) -> Axes:
    axes = figure.add_subplot()
    axes.grid(color="#e6e9ed", linewidth=0.8)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    axes.tick_params(colors=_INK, labelsize=9)
    return axes


def _legend(figure: Figure, axes: Axes) -> None:
    handles, labels = axes.get_legend_handles_labels()
    columns = max(1, int(figure.get_figwidth() // 2.2))
    figure.legend(handles, labels, loc="outside upper left", ncols=columns, frameon=False, fontsize=9)


def _png(figure: Figure) -> bytes:
    picture = io.BytesIO()
    figure.savefig(picture, format="png", dpi=110, metadata={"Software": None})
    return picture.getvalue()
