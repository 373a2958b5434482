"""radio.png: over the grid map, how well the building is covered, where access points stand, and where holes are."""

import io
import math
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PatchCollection
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Ellipse, Patch, Rectangle
from PIL import Image

from wayfi.backend.grid.occupancy_grid import OccupancyGrid
from wayfi.frontends.radio.radio_map import AccessPoint, RadioMap
from wayfi.recordings.files.atomic_files import write_bytes

LEVELS_DBM = (-90.0, -40.0)  # of the colours
KNOWN_M = 8.0  # a position with a larger sigma is no dot on a plan
INCHES, DPI, LEGEND_INCHES = 11.0, 100, 1.5
_INK = "#17202b"
_WALL = ListedColormap([_INK])
_OCCUPIED = 0.6
_LEVEL_COLOURS = "viridis"  # of even lightness: it reads the same to the colour-blind, and in grey


def write_picture(path: Path, radio: RadioMap, grid: OccupancyGrid) -> None:
    """Write the picture. Raises OSError."""
    figure, axes = _figure(radio)
    image = axes.imshow(
        radio.cells.image(radio.best()[1]), cmap=_LEVEL_COLOURS, vmin=LEVELS_DBM[0], vmax=LEVELS_DBM[1],
        origin="lower", extent=_extent(radio), interpolation="nearest", alpha=0.9,
    )  # fmt: skip
    _draw_holes(axes, radio)
    _draw_walls(axes, grid)
    shown = [ap for ap in radio.access_points if _is_known(ap)]
    for ap in shown:
        _draw_access_point(axes, ap)
    _draw_scale_bar(axes)
    bar = figure.colorbar(image, ax=axes, orientation="horizontal", fraction=0.05, pad=0.02, aspect=50, extend="both")
    bar.set_label("level of the best access point, dBm (right is better)", color=_INK, fontsize=10)
    _draw_legend(figure, radio, len(shown))
    write_bytes(path, _png(figure))


def _is_known(ap: AccessPoint) -> bool:
    return ap.sigmas_m is not None and ap.sigmas_m[0] <= KNOWN_M


def _extent(radio: RadioMap) -> tuple[float, float, float, float]:
    cells = radio.cells
    x, y = cells.origin_xy_m
    return x, x + cells.shape[1] * cells.cell_m, y, y + cells.shape[0] * cells.cell_m


def _figure(radio: RadioMap) -> tuple[Figure, Axes]:
    """A figure of what is covered and of the access points whose places are known."""
    left, right, bottom, top = _extent(radio)
    for ap in filter(_is_known, radio.access_points):
        assert ap.xy is not None
        x, y = ap.xy.tolist()
        left, right, bottom, top = min(left, x - 2), max(right, x + 2), min(bottom, y - 2), max(top, y + 2)
    width, height = right - left, (top - bottom) * 1.04
    scale = INCHES / max(width, height)
    size = max(6.0, width * scale), max(3.0, height * scale) + LEGEND_INCHES
    figure = Figure(figsize=size, dpi=DPI, layout="constrained", facecolor="white")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    axes.set(xlim=(left, right), ylim=(bottom - 0.04 * (top - bottom), top), aspect="equal", autoscale_on=False)
    axes.set_axis_off()
    return figure, axes


def _draw_walls(axes: Axes, grid: OccupancyGrid) -> None:
    """The occupied cells of the grid map, in ink."""
    probability = grid.probability()
    walls = np.where(probability > _OCCUPIED, 1.0, np.nan)
    x, y = grid.origin_xy_m
    height, width = (side * grid.resolution_m for side in walls.shape)
    if walls.size and not np.isnan(walls).all():
        axes.imshow(walls, cmap=_WALL, origin="lower", extent=(x, x + width, y, y + height), interpolation="nearest")


def _draw_holes(axes: Axes, radio: RadioMap) -> None:
    """Hatch the cells where even the best level is of no use."""
    holes, cells = radio.holes(), radio.cells
    corners = cells.xy[holes] - cells.cell_m / 2
    squares = [Rectangle((x, y), cells.cell_m, cells.cell_m) for x, y in corners.tolist()]
    axes.add_collection(PatchCollection(squares, facecolor="none", edgecolor="white", linewidth=0.0, hatch="////"))


def _draw_access_point(axes: Axes, ap: AccessPoint) -> None:
    """A triangle where it stands, in the ellipse of one sigma."""
    assert ap.xy is not None
    assert ap.covariance is not None
    variances, directions = np.linalg.eigh(ap.covariance)
    angle = math.degrees(math.atan2(directions[1, 1], directions[0, 1]))
    x, y = ap.xy.tolist()
    width, height = (2 * np.sqrt(variances[::-1])).tolist()
    axes.add_patch(Ellipse((x, y), width, height, angle=angle, facecolor="none", edgecolor="white", linewidth=2.0))
    axes.add_patch(Ellipse((x, y), width, height, angle=angle, facecolor="none", edgecolor=_INK, linewidth=0.8))
    axes.plot(x, y, "^", color="white", markeredgecolor=_INK, markersize=7)


def _draw_scale_bar(axes: Axes) -> None:
    (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    longest = max(right - left, top - bottom) / 5
    decade = 10.0 ** math.floor(math.log10(longest))
    length = max(step * decade for step in (1, 2, 5) if step * decade <= longest)
    x, y = left + 0.02 * (right - left), bottom + 0.012 * (top - bottom)
    axes.plot([x, x + length], [y, y], color=_INK, linewidth=4, solid_capstyle="butt")
    axes.text(x + length, y, f"  {length:g} m", ha="left", va="center", color=_INK, fontsize=10)


def _draw_legend(figure: Figure, radio: RadioMap, shown: int) -> None:
    rest = len(radio.access_points) - shown
    triangle = Line2D([], [], marker="^", color="none", markerfacecolor="white", markeredgecolor=_INK, markersize=8)
    ellipse = Line2D([], [], marker="o", color="none", markerfacecolor="none", markeredgecolor=_INK, markersize=11)
    hole = Patch(facecolor="#cccccc", edgecolor="white", hatch="////")
    entries = {
        f"{shown} access points ({rest} more are not known to {KNOWN_M:g} m)": triangle,
        "one sigma of the position": ellipse,
        f"hole: below {radio.usable_dbm:g} dBm": hole,
    }
    figure.legend(
        list(entries.values()), list(entries), loc="outside lower center", ncols=3, frameon=False, fontsize=10,
        labelcolor=_INK,
    )  # fmt: skip


def _png(figure: Figure) -> bytes:
    raw, packed = io.BytesIO(), io.BytesIO()
    figure.savefig(raw, format="rgba", dpi=DPI)
    size = FigureCanvasAgg(figure).get_width_height()
    image = Image.frombytes("RGBA", size, raw.getvalue()).convert("RGB")
    image.save(packed, "PNG", optimize=True)
    return packed.getvalue()
