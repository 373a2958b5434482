"""The occupancy grid as a picture, with a scale bar and the path driven."""

import io
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageColor, ImageDraw, ImageFont

from wayfi.backend.grid.occupancy_grid import OccupancyGrid
from wayfi.backend.pose2 import Floats

_INK = "#17202b"
_SHADES = {0.0: "#ffffff", 0.25: "#ffffff", 0.5: "#dfe3e8", 0.65: "#59636f", 0.8: _INK, 1.0: _INK}  # by probability
_GREYS = np.column_stack(
    [
        np.interp(np.linspace(0.0, 1.0, 256), list(_SHADES), channel).round().astype(np.uint8)
        for channel in zip(*map(ImageColor.getrgb, _SHADES.values()), strict=True)
    ]
)
_PATH, _PATH_OPACITY, _PATH_PX = "#2f7ed8", 0.8, 1.4
_LONG_SIDE_PX, _SHORT_SIDE_PX = 2200, 400
_PADDING, _SCALE_BAR_SPACE = 0.015, 0.035  # of the longer side
_SCALE_BAR_PX, _FONT_PX, _BOX = 6, 17, (255, 255, 255, 178)
_MIN_KNOWN_CELLS = 10  # in a row or column at the edge
_OCCUPIED = 0.6  # a cell over it darkens all of its pixel
_STEPS_PER_PX = 4  # along the path
_AT_ONCE = 20_000  # steps: bounds the memory, however far a robot drove

_Extent = tuple[float, float, float, float]
_Pixels = NDArray[np.uint8]


class _Frame(NamedTuple):
    """Where a picture lies in `map`: its upper left corner (m), its size in pixels and how wide those are."""

    left_m: float
    top_m: float
    columns: int
    rows: int
    pixel_m: float

    def pixels(self, xy_m: Floats) -> Floats:
        """(n, 2) columns and rows of positions (n, 2) m; a pixel's middle is at a half."""
        return (xy_m - (self.left_m, self.top_m)) / (self.pixel_m, -self.pixel_m)


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
    frame = _frame(shown, extent, grid.resolution_m * cells / pixels)
    picture = _drawn(probability, extent, pixels, frame)
    if path_xy_m is not None:
        _draw_path(picture, frame.pixels(path_xy_m))
    image = Image.fromarray(picture)
    _draw_scale_bar(image, frame.pixel_m)
    packed = io.BytesIO()
    image.save(packed, "PNG")
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
    if cells == 1:
        return probability, extent
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


def _frame(shown: _Extent, extent: _Extent, pixel_m: float) -> _Frame:
    """The frame of a picture of the extent `shown`; pixels are aligned to the upper left of `extent`."""
    left, right, bottom, top = shown
    columns, rows = (max(math.ceil(side / pixel_m), _SHORT_SIDE_PX) for side in (right - left, top - bottom))
    left, top = (left + right - columns * pixel_m) / 2, (bottom + top + rows * pixel_m) / 2
    left, top = (at - math.remainder(at - edge, pixel_m) for at, edge in ((left, extent[0]), (top, extent[3])))
    return _Frame(left, top, columns, rows, pixel_m)


def _drawn(probability: Floats, extent: _Extent, pixels: int, frame: _Frame) -> _Pixels:
    """(rows, columns, 3) the cells, `pixels` x `pixels` each, on what is unknown."""
    shades = np.full((frame.rows, frame.columns), 128, np.uint8)
    cells = np.minimum(probability[::-1] * 256, 255).astype(np.uint8).repeat(pixels, axis=0).repeat(pixels, axis=1)
    column, row = frame.pixels(np.array([[extent[0], extent[3]]]))[0].round().astype(int)
    shades[row : row + cells.shape[0], column : column + cells.shape[1]] = cells
    return _GREYS[shades]


def _draw_path(picture: _Pixels, points: Floats) -> None:
    """Draw the line through `points` (n, 2) columns and rows."""
    drawn = _covered(picture.shape[:2], points)
    at = np.nonzero(drawn)
    opacity = _PATH_OPACITY * drawn[at][:, None]
    picture[at] = np.rint((1 - opacity) * picture[at] + opacity * ImageColor.getrgb(_PATH))


def _covered(shape: tuple[int, int], points: Floats) -> Floats:
    """(rows, columns) how much of each pixel a line through `points` (n, 2) covers, from 0 to 1."""
    covered = np.zeros(shape)
    along = np.append(0.0, np.cumsum(np.hypot(*np.diff(points, axis=0).T)))[: len(points)]
    steps = np.arange(0.0, along[-1] if len(along) else 0.0, 1 / _STEPS_PER_PX)
    line = np.column_stack([np.interp(steps, along, axis) for axis in points.T]) if len(steps) else points
    around = np.stack(np.meshgrid([-1, 0, 1], [-1, 0, 1]), axis=-1).reshape(-1, 2)
    for first in range(0, len(line), _AT_ONCE):
        part = line[first : first + _AT_ONCE, None]
        pixels = np.floor(part).astype(int) + around
        distance = np.hypot(*np.moveaxis(pixels + 0.5 - part, -1, 0))
        np.maximum.at(covered, (pixels[..., 1], pixels[..., 0]), np.clip(_PATH_PX / 2 + 0.5 - distance, 0.0, 1.0))
    return covered


def _draw_scale_bar(image: Image.Image, pixel_m: float) -> None:
    """A bar of 1, 2 or 5 x 10^k m, at most a fifth of the longer side, in the lower left corner."""
    longer = max(image.size)
    length_m = _round_length(pixel_m * min(longer / 5, image.width / 2))
    left, right, bottom = 0.015 * longer, 0.015 * longer + length_m / pixel_m, image.height - 0.015 * longer
    draw = ImageDraw.Draw(image, "RGBA")
    draw.rectangle((left, bottom - _SCALE_BAR_PX / 2, right, bottom + _SCALE_BAR_PX / 2 - 1), fill=_INK)
    place, words = ((left + right) / 2, bottom - 0.008 * longer), f"{length_m:g} m"
    font = ImageFont.load_default(_FONT_PX)
    box = draw.textbbox(place, words, font, anchor="mb")
    draw.rectangle((box[0] - 2, box[1] - 2, box[2] + 2, box[3] + 2), fill=_BOX)
    draw.text(place, words, _INK, font, anchor="mb")


def _round_length(longest_m: float) -> float:
    decade = 10.0 ** np.floor(np.log10(longest_m))
    return float(max(step * decade for step in (1, 2, 5) if step * decade <= longest_m))
