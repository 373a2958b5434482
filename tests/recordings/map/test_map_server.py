"""A saved map as Nav2's map_server reads it, by the rules of its map_io, and the masks that stand beside it."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from building_maps.made_up import made_up_map
from numpy.typing import NDArray
from PIL import Image

from wayfi.frontends.frames.frames_config import FramesConfig
from wayfi.recordings.map.loading import load_map
from wayfi.recordings.map.saving import MapSaver, save_map

ALIGNED = 1e-6  # m: nav2_costmap_2d warns of an origin that is no multiple of the resolution


@dataclass(frozen=True, slots=True, eq=False)
class OccupancyGrid:
    """nav_msgs/OccupancyGrid: `cells` (rows, columns), row 0 at the origin."""

    cells: NDArray[np.int8]
    resolution: float
    origin: Sequence[float]


def map_server(yaml: Path) -> OccupancyGrid:
    """The grid that map_server publishes: every key is required but `mode`; the image is relative to the YAML file."""
    keys = dict(line.split(": ", 1) for line in yaml.read_text().splitlines() if line)
    image = keys["image"]
    assert image
    with Image.open(Path(image) if image.startswith("/") else yaml.parent / image) as opened:
        grey = np.asarray(opened.convert("RGB"), float).mean(axis=2) / 255
    origin = [float(word) for word in keys["origin"].strip("[]").split(",")]
    assert len(origin) == 3
    occupied_above, free_below = float(keys["occupied_thresh"]), float(keys["free_thresh"])
    occupied = grey if int(keys["negate"]) else 1.0 - grey
    assert keys.get("mode", "trinary") == "trinary"
    cells = np.where(occupied_above < occupied, 100, np.where(occupied < free_below, 0, -1)).astype(np.int8)
    return OccupancyGrid(cells[::-1], float(keys["resolution"]), origin)


@pytest.fixture
def saved(tmp_path: Path) -> Path:
    save_map(tmp_path / "map", made_up_map(30))
    return tmp_path / "map"


def test_map_server_reads_the_grid_of_a_saved_map(saved: Path) -> None:
    kept = load_map(saved).building.grid
    probability = kept.probability()
    served = map_server(saved / "map.yaml")
    np.testing.assert_array_equal(served.cells == 100, probability >= 0.65)
    np.testing.assert_array_equal(served.cells == 0, probability <= 0.25)
    assert {100, 0, -1} == set(np.unique(served.cells).tolist())
    assert served.resolution == kept.resolution_m
    assert served.origin == pytest.approx([*kept.origin_xy_m, 0.0], abs=ALIGNED)


def test_its_origin_is_aligned_with_its_cells(saved: Path) -> None:
    served = map_server(saved / "map.yaml")
    cells = np.array(served.origin[:2]) / served.resolution
    np.testing.assert_allclose(cells, np.round(cells), atol=ALIGNED / served.resolution)


def test_masks_that_the_user_puts_beside_it_stay_when_the_map_goes_on(saved: Path) -> None:
    rows, columns = map_server(saved / "map.yaml").cells.shape
    mask = np.full((rows, columns), 254, np.uint8)
    mask[: rows // 2] = 0
    for name in ("keepout", "speed"):
        Image.fromarray(mask).save(saved / f"{name}.pgm")
        text = (saved / "map.yaml").read_text().replace("image: map.pgm", f"image: {name}.pgm")
        (saved / f"{name}.yaml").write_text(text)
    before = {path.name: path.read_bytes() for path in saved.iterdir() if path.stem in ("keepout", "speed")}
    assert len(before) == 4
    named = load_map(saved).name
    MapSaver(saved, former=named).save(made_up_map(40))
    assert load_map(saved).map_version == named.map_version + 1
    assert {path.name: path.read_bytes() for path in saved.iterdir() if path.name in before} == before
    assert (map_server(saved / "keepout.yaml").cells[rows // 2 + 1 :] == 100).all()


def test_the_manifest_names_the_frames_that_are_set(tmp_path: Path) -> None:
    MapSaver(tmp_path, frames=FramesConfig(map="hall", base_link="robot1/base_link")).save(made_up_map(5))
    assert load_map(tmp_path).manifest.frames == {"map": "hall", "base": "robot1/base_link"}
