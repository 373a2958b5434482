import io
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest
from numpy.typing import NDArray

from wayfi.backend.grid.map_config import MapConfig
from wayfi.backend.grid.occupancy_grid import OccupancyGrid
from wayfi.recordings.files.atomic_files import write_bytes, write_text
from wayfi.recordings.files.map_files import write_map
from wayfi.recordings.files.map_picture import map_png

CONFIG = MapConfig()


def grid() -> OccupancyGrid:
    evidence = np.zeros((40, 60), np.int8)
    evidence[5:35, 5:55] = -3
    evidence[5, 5:55] = 2
    return OccupancyGrid(evidence, 0.05, (-1.25, 2.5))


def map_server_reads(directory: Path) -> tuple[NDArray[np.int8], dict[str, str]]:
    """Nav2's map_server (nav2_map_server/map_io.cpp, trinary): 100 occupied, 0 free, -1 unknown, row 0 lowest."""
    lines = (directory / "map.yaml").read_text().splitlines()
    keys = dict(line.split(": ", 1) for line in lines)
    data = (directory / keys["image"]).read_bytes()
    magic, size, deepest, pixels = data.split(b"\n", 3)
    assert (magic, deepest) == (b"P5", b"255")
    columns, rows = map(int, size.split())
    occupancy = (255 - np.frombuffer(pixels, np.uint8).reshape(rows, columns).astype(float)) / 255
    cells = np.full((rows, columns), -1, np.int8)
    cells[occupancy > float(keys["occupied_thresh"])] = 100
    cells[occupancy < float(keys["free_thresh"])] = 0
    return cells[::-1], keys


def test_map_server_reads_what_the_grid_says(tmp_path: Path) -> None:
    write_map(tmp_path, grid(), CONFIG)
    cells, keys = map_server_reads(tmp_path)
    expected = np.full((40, 60), -1)
    expected[5:35, 5:55] = 0
    expected[5, 5:55] = 100
    np.testing.assert_array_equal(cells, expected)
    assert keys == {
        "image": "map.pgm",
        "mode": "trinary",
        "resolution": "0.05",
        "origin": "[-1.250000, 2.500000, 0.0]",
        "negate": "0",
        "occupied_thresh": "0.65",
        "free_thresh": "0.25",
    }


def pixels_of(picture: bytes) -> NDArray[np.uint8]:
    """(rows, columns, 3): another reader's view of a PNG."""
    return (matplotlib.image.imread(io.BytesIO(picture), format="png")[:, :, :3] * 255).round().astype(np.uint8)


def test_the_picture_is_a_png_of_bounded_size_with_and_without_a_path(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    large = OccupancyGrid(rng.choice([-5, 0, 9], (3000, 2500)).astype(np.int8), 0.05, (0.0, 0.0))
    unknown = OccupancyGrid(np.zeros((40, 40), np.int8), 0.05, (0.0, 0.0))
    for drawn, path in ((large, None), (grid(), np.array([[-1.0, 3.0], [0.0, 4.0]])), (unknown, np.empty((0, 2)))):
        write_map(tmp_path, drawn, CONFIG, path)
        rows, columns, _ = pixels_of((tmp_path / "map.png").read_bytes()).shape
        assert 1000 < max(rows, columns) <= 2200


@pytest.mark.parametrize(("side", "cells", "pixels"), [(130, 1, 8), (1500, 1, 1), (3300, 2, 1)])
def test_a_cell_is_a_whole_number_of_pixels_of_one_colour(side: int, cells: int, pixels: int) -> None:
    evidence = np.full((side, side), -5, np.int8)
    evidence[cells * 20 : cells * 21] = 9
    picture = pixels_of(map_png(OccupancyGrid(evidence, 0.05, (0.3, -7.1))))
    free = (picture == 255).all(axis=2)
    columns = np.flatnonzero(free.any(axis=0))
    assert np.ptp(columns) + 1 == len(columns) == side // cells * pixels
    colours = picture[:, columns[len(columns) // 2]]
    rows = np.flatnonzero((colours == 255).all(axis=1))
    assert len(rows) == (side // cells - 1) * pixels
    wall = colours[rows[0] : rows[-1] + 1][~(colours[rows[0] : rows[-1] + 1] == 255).all(axis=1)]
    assert len(wall) == pixels
    assert len(np.unique(wall, axis=0)) == 1


def test_the_path_is_drawn_where_it_was_driven_and_the_scale_bar_is_as_long_as_it_says() -> None:
    cells, cell_m = 1300, 0.05  # 65 m: the bar is of 10 m, and a cell is a pixel
    drawn = OccupancyGrid(np.full((cells, cells), -5, np.int8), cell_m, (0.0, 0.0))
    corner = np.array([[0.5, 2.5], [0.5, 40.5], [30.5, 40.5]]) * cell_m + [10.0, 20.0]
    picture = pixels_of(map_png(drawn, corner)).astype(int)
    rows, columns = np.nonzero((picture == 255).all(axis=2))
    left, lowest = columns.min(), rows.max()
    blue = picture[:, :, 2] - picture[:, :, 0] > 100
    rows, columns = np.nonzero(blue)
    assert (np.ptp(rows), np.ptp(columns)) == (38, 30)
    assert (columns.min() - left, lowest - rows.max()) == (200, 402)
    line = picture[rows.max() - 10, columns.min()]
    np.testing.assert_allclose(line, 0.8 * np.array([0x2F, 0x7E, 0xD8]) + 0.2 * 255, atol=2)
    ink = (picture == [0x17, 0x20, 0x2B]).all(axis=2)
    assert ink.sum(axis=1).max() == pytest.approx(10.0 / cell_m, abs=1)


def test_single_rays_through_a_window_do_not_shrink_the_picture() -> None:
    evidence = np.zeros((400, 400), np.int8)
    evidence[:100, :100] = -5
    room = map_png(OccupancyGrid(evidence.copy(), 0.05, (0.0, 0.0)))
    evidence[50, 100:] = -1
    evidence[100:, 50] = -1
    assert map_png(OccupancyGrid(evidence, 0.05, (0.0, 0.0))) == room


def test_the_same_grid_gives_the_same_bytes(tmp_path: Path) -> None:
    names = ("map.pgm", "map.yaml", "map.png")
    write_map(tmp_path, grid(), CONFIG)
    first = [(tmp_path / name).read_bytes() for name in names]
    write_map(tmp_path, grid(), CONFIG)
    assert first == [(tmp_path / name).read_bytes() for name in names]
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(names)


def test_a_write_that_fails_leaves_the_old_file_and_no_other(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_text(tmp_path / "a.txt", "old\n")

    def full(*_: object) -> int:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "replace", full)
    with pytest.raises(OSError, match="No space"):
        write_bytes(tmp_path / "a.txt", b"new\n")
    assert [(path.name, path.read_text()) for path in tmp_path.iterdir()] == [("a.txt", "old\n")]
