"""The occupancy grid as a picture, with a scale bar and the path driven."""

import io
import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from PIL import Image

from wayfi.backend.grid.occupancy_grid import OccupancyGrid
from wayfi.backend.pose2 import Floats

_INK = "#17202b"
_SHADES = [(0, "#ffffff"), (0.25, "#ffffff"), (0.5, "#dfe3e8"), (0.65, "#59636f"), (0.8, _INK), (1, _INK)]
_GREYS = LinearSegmentedColormap.from_list("occupancy", _SHADES)
_PATH = "#2f7ed8"
_LONG_SIDE_PX, _SHORT_SIDE_PX, _DPI = 2200, 400, 100
_PADDING, _SCALE_BAR_SPACE = 0.015, 0.035  # of the longer side
_MIN_KNOWN_CELLS = 10  # in a row or column at the edge
_OCCUPIED = 0.6  # a cell over it darkens all of its pixel

_Extent = tuple[float, float, float, float]


def map_png(grid: OccupancyGrid, path_xy_m: Floats | None = None) -> bytes:
    """A PNG of the known part of `grid`, with the path `path_xy_m` (n, 2) m if given.

    Its longer side has 1100 to 2200 pixels. A pixel covers a whole number of cells, or a cell a whole number of pixels,
    so that walls stay sharp.
    """
    probability, extent = _cropped(grid)
    shown = _shown(extent, path_xy_m)
    longer = max(shown[1] - shown[0], shown[3] - shown[2]) / grid.resolution_m
    cells, pixels = max(1, math.ceil(longer / _LONG_SIDE_PX)), math.ceil(_LONG_SIDE_PX / 2 / longer)
    probability, extent = _merged(probability, extent, cells)
    figure, axes = _figure(shown, extent, grid.resolution_m * cells / pixels)
    axes.imshow(probability, cmap=_GREYS, vmin=0, vmax=1, origin="lower", extent=extent, interpolation="nearest")
    if path_xy_m is not None:
        axes.plot(*path_xy_m.T, color=_PATH, linewidth=1.0, alpha=0.8, scalex=False, scaley=False)
    _draw_scale_bar(axes)
    return _png(figure)


def _png(figure: Figure) -> bytes:
    """The figure as a PNG without alpha channel."""
    raw, packed = io.BytesIO(), io.BytesIO()
    figure.savefig(raw, format="rgba")
    size = FigureCanvasAgg(figure).get_width_height()
    Image.frombytes("RGBA", size, raw.getvalue()).convert("RGB").save(packed, "PNG", optimize=True)
    return packed.getvalue()


def _cropped(grid: OccupancyGrid) -> tuple[Floats, _Extent]:
    """The probabilities of the rectangle of known cells (of all cells if none is known), and its extent (m).

    Rows and columns at the edges with fewer than `_MIN_KNOWN_CELLS` known cells are cut: single rays through a window.
    """
    known = grid.evidence != 0
    rows, columns = (np.flatnonzero(known.sum(axis=axis) >= _MIN_KNOWN_CELLS) for axis in (1, 0))
    if rows.size == 0 or columns.size == 0:
        rows, columns = np.arange(known.shape[0]), np.arange(known.shape[1])
    cut = np.s_[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    x, y = np.array(grid.origin_xy_m) + grid.resolution_m * np.array([columns[0], rows[0]])
    height, width = grid.resolution_m * np.array(known[cut].shape)
    return grid.probability()[cut].astype(np.float64), (x, x + width, y, y + height)


def _merged(probability: Floats, extent: _Extent, cells: int) -> tuple[Floats, _Extent]:
    """Blocks of `cells` x `cells` merged into one value each; the extent grows by less than a block."""
    rows, columns = (-(-size // cells) for size in probability.shape)
    full = np.full((rows * cells, columns * cells), 0.5)
    full[: probability.shape[0], : probability.shape[1]] = probability
    blocks = full.reshape(rows, cells, columns, cells)
    highest = blocks.max(axis=(1, 3))
    left, right, bottom, top = extent
    width, height = (right - left) / probability.shape[1] * full.shape[1], (top - bottom) / len(probability) * len(full)
    merged = np.where(highest > _OCCUPIED, highest, blocks.mean(axis=(1, 3)))
    return merged, (left, left + width, bottom, bottom + height)


def _shown(extent: _Extent, path_xy_m: Floats | None) -> _Extent:
    """The extent of the picture: `extent` and the path, padding, and space for the scale bar below."""
    left, right, bottom, top = extent
    if path_xy_m is not None and len(path_xy_m):
        (x_low, y_low), (x_high, y_high) = path_xy_m.min(axis=0), path_xy_m.max(axis=0)
        left, right, bottom, top = min(left, x_low), max(right, x_high), min(bottom, y_low), max(top, y_high)
    longer = max(right - left, top - bottom)
    padding = _PADDING * longer
    return left - padding, right + padding, bottom - padding - _SCALE_BAR_SPACE * longer, top + padding


def _figure(shown: _Extent, extent: _Extent, pixel_m: float) -> tuple[Figure, Axes]:
    """An empty figure of the extent `shown`; pixels are `pixel_m` wide and aligned to the lower left of `extent`."""
    left, right, bottom, top = shown
    width, height = (max(math.ceil(side / pixel_m), _SHORT_SIDE_PX) for side in (right - left, top - bottom))
    left, bottom = (left + right - width * pixel_m) / 2, (bottom + top - height * pixel_m) / 2
    left, bottom = (at - math.remainder(at - edge, pixel_m) for at, edge in ((left, extent[0]), (bottom, extent[2])))
    figure = Figure(figsize=(width / _DPI, height / _DPI), dpi=_DPI, facecolor=_GREYS(0.5))
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set_axis_off()
    axes.set(xlim=(left, left + width * pixel_m), ylim=(bottom, bottom + height * pixel_m), autoscale_on=False)
    return figure, axes


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
