"""The grid with three kinds of cells: the same made of probabilities and read from its files."""

from pathlib import Path

import numpy as np
import pytest

from wayfi.backend.grid.map_config import MapConfig
from wayfi.frontends.events import GridRedrawn
from wayfi.recordings.files.map_files import write_grid
from wayfi.recordings.files.map_folder import MapError
from wayfi.recordings.files.trinary_grid import FREE, OCCUPIED, UNKNOWN, read_map, trinary

OCCUPANCY = np.array([[0.1, 0.5, 0.9], [0.65, 0.25, 0.3]], np.float32)
ORIGIN = (-1.25, 3.5)


def test_the_thresholds_decide() -> None:
    grid = trinary(OCCUPANCY, 0.05, ORIGIN, MapConfig())
    assert grid.cells.tolist() == [[FREE, UNKNOWN, OCCUPIED], [OCCUPIED, FREE, UNKNOWN]]
    assert grid.cells.dtype == np.int8


def test_what_is_written_is_read_again(tmp_path: Path) -> None:
    write_grid(tmp_path, GridRedrawn(0, OCCUPANCY, 0.05, ORIGIN), MapConfig())
    grid = read_map(tmp_path)
    np.testing.assert_array_equal(grid.cells, trinary(OCCUPANCY, 0.05, ORIGIN, MapConfig()).cells)
    assert (grid.resolution_m, grid.origin_xy_m) == (0.05, ORIGIN)


@pytest.mark.parametrize(
    ("file", "content"),
    [
        ("map.yaml", b"image: map.pgm\n"),
        ("map.yaml", b"nonsense"),
        ("map.yaml", b"\xff"),
        ("map.yaml", b"resolution: 0.05\norigin: [0, 0]\n"),
        ("map.pgm", b"P2\n3 2\n255\n000000"),
        ("map.pgm", b"P5\n3 3\n255\n000000"),
        ("map.pgm", b""),
    ],
)
def test_what_is_no_map_is_said(file: str, content: bytes, tmp_path: Path) -> None:
    write_grid(tmp_path, GridRedrawn(0, OCCUPANCY, 0.05, ORIGIN), MapConfig())
    (tmp_path / file).write_bytes(content)
    with pytest.raises(MapError, match=r"map\.pgm and map\.yaml are no map of wayfi"):
        read_map(tmp_path)


def test_a_map_that_is_not_there_is_said(tmp_path: Path) -> None:
    with pytest.raises(MapError, match=r"map\.yaml: cannot be read: No such file"):
        read_map(tmp_path)
