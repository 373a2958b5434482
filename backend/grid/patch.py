"""Patches of the occupancy grid: the evidence in a rectangle of cells, and how patches add up to one grid.

Rows and columns are those of the whole map, in every patch: cell (row, column) covers [column, column + 1) in x and
[row, row + 1) in y, in widths of a cell.
"""

from collections.abc import Iterable
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.grid.sensor_model import MAX_EVIDENCE, MIN_EVIDENCE


class CellWindow(NamedTuple):
    """The cells from (`row`, `column`) to (`row_end`, `column_end`), the latter excluded."""

    row: int
    column: int
    row_end: int
    column_end: int

    @property
    def shape(self) -> tuple[int, int]:
        """Number of rows and of columns; 0 where an end is not above its start."""
        return max(self.row_end - self.row, 0), max(self.column_end - self.column, 0)

    def is_within(self, other: Self) -> bool:
        """Whether all of its cells are in `other`; True for a window without cells."""
        return 0 in self.shape or self.intersection(other) == self

    def intersection(self, other: Self) -> "CellWindow":
        """The cells that are in both windows."""
        return CellWindow(
            max(self.row, other.row),
            max(self.column, other.column),
            min(self.row_end, other.row_end),
            min(self.column_end, other.column_end),
        )

    def padded(self, cells: int) -> "CellWindow":
        """The window with `cells` more on every side."""
        return CellWindow(self.row - cells, self.column - cells, self.row_end + cells, self.column_end + cells)


EMPTY = CellWindow(0, 0, 0, 0)


def bounding_window(windows: Iterable[CellWindow]) -> CellWindow:
    """The smallest window around all windows that hold a cell; EMPTY where none does."""
    sides = np.array([window for window in windows if 0 not in window.shape]).reshape(-1, 4)
    if len(sides) == 0:
        return EMPTY
    row, column = sides[:, :2].min(axis=0).tolist()
    row_end, column_end = sides[:, 2:].max(axis=0).tolist()
    return CellWindow(row, column, row_end, column_end)


class Patch:
    """`evidence` (rows, columns) int8 of the cells of `window`: positive for occupied, negative for free."""

    def __init__(self, window: CellWindow, evidence: NDArray[np.int8] | None = None) -> None:
        self.window = window
        self.evidence = np.zeros(window.shape, np.int8) if evidence is None else evidence

    def cells(self, window: CellWindow) -> NDArray[np.int8]:
        """A view of the evidence in `window`, which must be within its own."""
        row, column = window.row - self.window.row, window.column - self.window.column
        rows, columns = window.shape
        return self.evidence[row : row + rows, column : column + columns]

    def expanded_to(self, window: CellWindow, slack: int) -> "Patch":
        """Itself, if it contains `window`; else a copy that does, with `slack` cells around that window."""
        if window.is_within(self.window):
            return self
        larger = Patch(bounding_window([window.padded(slack), self.window]))
        larger.cells(self.window)[:] = self.evidence
        return larger

    def add(self, newer: "Patch", window: CellWindow) -> int:
        """Add the evidence of a newer patch in `window`, within the bounds; returns how many cells it touched.

        With bounds, newer evidence wins after some scans: what has moved away fades, and what has come is drawn.
        """
        window = window.intersection(newer.window).intersection(self.window)
        if 0 in window.shape:
            return 0
        cells = self.cells(window)
        cells += newer.cells(window)
        np.clip(cells, MIN_EVIDENCE, MAX_EVIDENCE, out=cells)
        return cells.size
