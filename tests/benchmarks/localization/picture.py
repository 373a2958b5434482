"""A picture of a run: the map, the true path, the claims coloured by right and wrong, and the states over time."""

from pathlib import Path

import matplotlib
import numpy as np
from benchmarks.localization.experiments import Result
from benchmarks.localization.scoring import errors
from matplotlib.axes import Axes

from wayfi.backend.graph.health import State
from wayfi.frontends.measurements import SECOND_NS

matplotlib.use("Agg")
from matplotlib import pyplot as plt

STATES = [state.value for state in State]


def draw(result: Result, path: Path) -> None:
    """Write the picture of `result` to the PNG `path`."""
    figure, (above, below) = plt.subplots(2, 1, figsize=(11, 10), height_ratios=(3, 1), layout="constrained")
    _draw_map(above, result)
    _draw_states(below, result)
    found = "not found" if result.score.found_s is None else f"found after {result.score.found_s:.1f} s of driving"
    figure.suptitle(f"{result.name}: {found}, end {result.score.end}, {result.score.false} false claims")
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=80)
    plt.close(figure)


def _draw_map(axes: Axes, result: Result) -> None:
    grid = result.known.building.grid
    occupancy = grid.probability()
    rows, columns = occupancy.shape
    (x, y), size = grid.origin_xy_m, grid.resolution_m
    extent = (x, x + columns * size, y, y + rows * size)
    axes.imshow(1 - occupancy, origin="lower", extent=extent, cmap="gray", vmin=-0.5, vmax=1, interpolation="none")
    truth, run = result.truth, result.run
    during = (truth.stamps_ns >= run.start_ns) & (truth.stamps_ns <= run.end_ns)
    T_map_truth = result.known.T_truth_map.inverse()
    path = T_map_truth.transform(truth.poses[during][:, :2])
    axes.plot(*path.T, color="tab:blue", linewidth=1.5, label="truth")
    axes.plot(*path[:1].T, "o", color="tab:blue")
    if run.claims:
        claimed = np.array([claim.T_map_base.array() for claim in run.claims])
        colors = _colors(result)
        axes.scatter(claimed[:, 0], claimed[:, 1], c=colors, s=9, zorder=3)
    axes.legend()
    axes.set_aspect("equal")


def _colors(result: Result) -> list[str]:
    error_m, error_rad = errors(result.run.claims, result.truth, result.known.T_truth_map)
    right = (error_m <= result.bounds.right_m) & (error_rad <= result.bounds.right_rad)
    false = (error_m > result.bounds.false_m) | (error_rad > result.bounds.false_rad)
    return ["tab:green" if r else "tab:red" if f else "tab:orange" for r, f in zip(right, false, strict=True)]


def _draw_states(axes: Axes, result: Result) -> None:
    run = result.run
    for number, change in enumerate(run.changes):
        after = run.changes[number + 1].stamp_ns if number + 1 < len(run.changes) else run.end_ns
        row = STATES.index(change.state)
        begin, end = ((stamp_ns - run.start_ns) / SECOND_NS for stamp_ns in (change.stamp_ns, after))
        axes.plot([begin, end], [row, row], linewidth=4, color="tab:blue")
        axes.annotate(change.reason[:60], (begin, row), fontsize=6, rotation=12)
    claims_s = [(claim.stamp_ns - run.start_ns) / SECOND_NS for claim in run.claims]
    if claims_s:
        axes.scatter(claims_s, np.full(len(claims_s), -1), c=_colors(result), s=5)
    axes.set_yticks([-1, *range(len(STATES))], ["claims", *STATES])
    axes.set_xlim(0, (run.end_ns - run.start_ns) / SECOND_NS)
    axes.set_xlabel("s")
