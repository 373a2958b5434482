"""What some scans say of a rectangle of cells, and how such patches make one grid.

Cell (row, column) covers [column, column + 1) x [row, row + 1) cells of the map, whatever patch it is in.
"""

from collections.abc import Iterable
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

FREE_MOST = -5  # a cell that was free for long is occupied (p = 0.69) by three hits on end ...
OCCUPIED_MOST = 9  # ... and one that was a wall for long is unsure after eight passes, free (p = 0.23) after twelve


class CellWindow(NamedTuple):
    """The cells from (`row`, `column`) to (`row_end`, `column_end`), the latter excluded."""

    row: int
    column: int
    row_end: int
    column_end: int

    @property
    def shape(self) -> tuple[int, int]:
        """Rows, columns; neither is negative."""
        return max(self.row_end - self.row, 0), max(self.column_end - self.column, 0)

    def within(self, other: Self) -> bool:
        """Whether all of its cells are in `other`, if it has any."""
        return 0 in self.shape or self.overlap(other) == self

    def overlap(self, other: Self) -> "CellWindow":
        """The cells in both."""
        return CellWindow(
            max(self.row, other.row),
            max(self.column, other.column),
            min(self.row_end, other.row_end),
            min(self.column_end, other.column_end),
        )

    def grown(self, cells: int) -> "CellWindow":
        """`cells` more on every side."""
        return CellWindow(self.row - cells, self.column - cells, self.row_end + cells, self.column_end + cells)


NOWHERE = CellWindow(0, 0, 0, 0)


def around(windows: Iterable[CellWindow]) -> CellWindow:
    """The smallest window around all that hold a cell; NOWHERE where none does."""
    sides = np.array([window for window in windows if 0 not in window.shape]).reshape(-1, 4)
    if len(sides) == 0:
        return NOWHERE
    row, column = sides[:, :2].min(axis=0).tolist()
    row_end, column_end = sides[:, 2:].max(axis=0).tolist()
    return CellWindow(row, column, row_end, column_end)


class Patch:
    """`evidence` int8 of the cells of `window`, in passing rays: positive for occupied, negative for free."""

    def __init__(self, window: CellWindow, evidence: NDArray[np.int8] | None = None) -> None:
        self.window = window
        self.evidence = np.zeros(window.shape, np.int8) if evidence is None else evidence

    def cells(self, window: CellWindow) -> NDArray[np.int8]:
        """The evidence in `window`, which is within its own: a view."""
        row, column = window.row - self.window.row, window.column - self.window.column
        rows, columns = window.shape
        return self.evidence[row : row + rows, column : column + columns]

    def covering(self, window: CellWindow, slack: int) -> "Patch":
        """Itself, if that covers `window`; else a larger copy with `slack` cells to spare on every side."""
        if window.within(self.window):
            return self
        larger = Patch(around([window.grown(slack), self.window]))
        larger.cells(self.window)[:] = self.evidence
        return larger

    def add(self, newer: "Patch", window: CellWindow) -> int:
        """What a newer patch says of the cells in `window` weighs in; returns how many cells that is.

        Evidence adds up between bounds. So what was seen last wins once it was seen often enough: what moved away
        fades, and what came to stay is drawn.
        """
        window = window.overlap(newer.window).overlap(self.window)
        if 0 in window.shape:
            return 0
        cells = self.cells(window)
        cells += newer.cells(window)
        np.clip(cells, FREE_MOST, OCCUPIED_MOST, out=cells)
        return cells.size
