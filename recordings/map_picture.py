"""The occupancy grid as a picture: greys, a scale bar and the path driven."""

import io

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure

from wayfi.backend.grid_map import Floats, OccupancyGrid

_GREYS = LinearSegmentedColormap.from_list("occupancy", [(0.0, "#ffffff"), (0.5, "#dfe3e8"), (1.0, "#17202b")])
_PATH, _INK = "#2f7ed8", "#17202b"
_LONG_SIDE_PX, _SHORT_SIDE_PX, _DPI = 1600, 400, 100
_PADDING, _SCALE_BAR_ROOM = 0.015, 0.035  # of the longer side


def map_png(grid: OccupancyGrid, path_xy_m: Floats | None = None) -> bytes:
    """A PNG of what is known of `grid`, at most 1600 pixels wide or high, with the (n, 2) m path where given."""
    probability, extent = _shrunk(*_cropped(grid))
    shown = _shown(extent, path_xy_m)
    figure = _figure(shown)
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set_axis_off()
    axes.imshow(probability, cmap=_GREYS, vmin=0, vmax=1, origin="lower", extent=extent, interpolation="antialiased")
    if path_xy_m is not None:
        axes.plot(*path_xy_m.T, color=_PATH, linewidth=1.0, alpha=0.8)
    _frame(axes, shown, figure.get_figwidth() / figure.get_figheight())
    _draw_scale_bar(axes)
    picture = io.BytesIO()
    figure.savefig(picture, format="png", dpi=_DPI, metadata={"Software": None})
    return picture.getvalue()


_Extent = tuple[float, float, float, float]


def _cropped(grid: OccupancyGrid) -> tuple[Floats, _Extent, float]:
    """The probabilities around the known cells (all, where none is known), their extent and resolution (m)."""
    known = grid.log_odds != 0
    rows, columns = np.flatnonzero(known.any(axis=1)), np.flatnonzero(known.any(axis=0))
    if rows.size == 0:
        rows, columns = np.arange(known.shape[0]), np.arange(known.shape[1])
    cut = np.s_[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    x, y = np.array(grid.origin_xy_m) + grid.resolution_m * np.array([columns[0], rows[0]])
    height, width = grid.resolution_m * np.array(known[cut].shape)
    return grid.probability()[cut].astype(np.float64), (x, x + width, y, y + height), grid.resolution_m


def _shrunk(probability: Floats, extent: _Extent, resolution_m: float) -> tuple[Floats, _Extent]:
    """Blocks of cells as one, where the picture has fewer pixels than the grid; an occupied cell darkens its block."""
    factor = max(1, max(probability.shape) // _LONG_SIDE_PX)
    rows, columns = (-(-size // factor) for size in probability.shape)
    full = np.full((rows * factor, columns * factor), 0.5)
    full[: probability.shape[0], : probability.shape[1]] = probability
    blocks = full.reshape(rows, factor, columns, factor)
    highest = blocks.max(axis=(1, 3))
    x, _, y, _ = extent
    cell_m = factor * resolution_m
    return np.where(highest > 0.6, highest, blocks.mean(axis=(1, 3))), (x, x + columns * cell_m, y, y + rows * cell_m)


def _shown(extent: _Extent, path_xy_m: Floats | None) -> _Extent:
    """`extent` and the path, a little around them, and room for the scale bar below."""
    left, right, bottom, top = extent
    if path_xy_m is not None and len(path_xy_m):
        (x_low, y_low), (x_high, y_high) = path_xy_m.min(axis=0), path_xy_m.max(axis=0)
        left, right, bottom, top = min(left, x_low), max(right, x_high), min(bottom, y_low), max(top, y_high)
    longer = max(right - left, top - bottom)
    padding = _PADDING * longer
    return left - padding, right + padding, bottom - padding - _SCALE_BAR_ROOM * longer, top + padding


def _figure(extent: _Extent) -> Figure:
    width, height = extent[1] - extent[0], extent[3] - extent[2]
    scale = _LONG_SIDE_PX / max(width, height)
    size = [max(side * scale, _SHORT_SIDE_PX) / _DPI for side in (width, height)]
    figure = Figure(figsize=(size[0], size[1]), facecolor=_GREYS(0.5))
    FigureCanvasAgg(figure)
    return figure


def _frame(axes: Axes, extent: _Extent, ratio: float) -> None:
    """Shows `extent`, in the middle, at the figure's `ratio` of width to height."""
    middle = (extent[0] + extent[1]) / 2, (extent[2] + extent[3]) / 2
    height = max(extent[3] - extent[2], (extent[1] - extent[0]) / ratio)
    axes.set_xlim(middle[0] - height * ratio / 2, middle[0] + height * ratio / 2)
    axes.set_ylim(middle[1] - height / 2, middle[1] + height / 2)


def _draw_scale_bar(axes: Axes) -> None:
    """A bar of 1, 2 or 5 x 10^k m, at most a fifth of the longer side, in the lower left corner."""
    (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    longer = max(right - left, top - bottom)
    length = _round_length(min(longer / 5, (right - left) / 2))
    x, y = left + 0.015 * longer, bottom + 0.015 * longer
    axes.plot([x, x + length], [y, y], color=_INK, linewidth=4, solid_capstyle="butt")
    box = {"facecolor": "white", "alpha": 0.7, "edgecolor": "none", "pad": 1.5}
    place = x + length / 2, y + 0.008 * longer
    axes.text(*place, f"{length:g} m", ha="center", va="bottom", color=_INK, fontsize=12, bbox=box)


def _round_length(longest_m: float) -> float:
    decade = 10.0 ** np.floor(np.log10(longest_m))
    return float(max(step * decade for step in (1, 2, 5) if step * decade <= longest_m))
