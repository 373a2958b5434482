"""The files of a radio map, read back by other means."""

import csv
from pathlib import Path

import numpy as np
import pytest
from building_maps.heard import heard_map, level_of, rounds
from PIL import Image

from wayfi.frontends.maps.building_map import BuildingMap
from wayfi.frontends.radio.radio_config import RadioConfig
from wayfi.frontends.radio.radio_map import RadioMap, radio_map
from wayfi.recordings.radio.writing import write_radio_map
from wayfi.recordings.rerun.radio_log import write_radio_log
from wayfi.recordings.rerun.viewer import find_log

NAMES = ("a0:00:00:00:00:01", "a0:11:22:33:44:55")


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, RadioMap, BuildingMap]:
    chance, xy = np.random.default_rng(1), rounds(1)
    levels = {name: level_of(place, xy, chance) for name, place in zip(NAMES, ([5, 5], [30, 10]), strict=True)}
    building = heard_map(xy, levels, chance)
    radio, folder = radio_map(building, RadioConfig()), tmp_path_factory.mktemp("radio")
    write_radio_map(folder, radio, building.grid)
    return folder, radio, building


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def test_a_geotiff_has_each_level_at_its_place_in_the_map(written: tuple[Path, RadioMap, BuildingMap]) -> None:
    folder, radio, _ = written
    with Image.open(folder / "levels" / "a0-11-22-33-44-55.tif") as image:
        tags, values = image.tag_v2, np.array(image)
    scale, (column, row, _, x, y, _) = tags[33550], tags[33922]
    assert (column, row) == (0, 0)
    ap = next(ap for ap in radio.access_points if NAMES[1] in ap.bssids)
    columns = np.floor((radio.cells.xy[:, 0] - x) / scale[0]).astype(int)
    lines = np.floor((y - radio.cells.xy[:, 1]) / scale[1]).astype(int)
    np.testing.assert_array_equal(values[lines, columns], ap.level)
    assert np.count_nonzero(~np.isnan(values)) == np.count_nonzero(~np.isnan(ap.level))
    assert tags[42113] == "nan"
    assert NAMES[1] in tags[270]


def test_the_tables_say_what_the_map_says(written: tuple[Path, RadioMap, BuildingMap]) -> None:
    folder, radio, _ = written
    aps, levels, coverage = (rows(folder / f"{name}.csv") for name in ("access_points", "levels", "coverage"))
    for row, ap in zip(aps, radio.access_points, strict=True):
        assert row["bssid"] == ap.bssids[0]
        assert ap.xy is not None
        assert [float(row["x_m"]), float(row["y_m"])] == pytest.approx(ap.xy.tolist(), abs=0.001)
        assert float(row["sigma_long_m"]) >= float(row["sigma_short_m"]) > 0
    assert len(levels) == sum(np.count_nonzero(~np.isnan(ap.level)) for ap in radio.access_points)
    assert len(coverage) == len(radio.cells.xy)
    assert float(coverage[7]["level_dbm"]) == pytest.approx(radio.best()[1][7], abs=0.051)


def test_the_picture_and_the_log_are_there(written: tuple[Path, RadioMap, BuildingMap]) -> None:
    folder, radio, building = written
    with Image.open(folder / "radio.png") as picture:
        assert min(picture.size) > 300
        assert len(np.unique(np.array(picture.convert("RGB")).reshape(-1, 3), axis=0)) > 20
    write_radio_log(folder / "radio.rrd", radio, building.grid)
    assert find_log(folder) == folder / "radio.rrd"


def test_access_points_that_are_gone_leave_no_files_behind(written: tuple[Path, RadioMap, BuildingMap]) -> None:
    folder, radio, building = written
    old, mine = folder / "levels" / "00-00-00-00-00-09.tif", folder / "levels" / "mine.tif"
    for path in (old, mine):
        path.write_bytes(b"")
    write_radio_map(folder, radio, building.grid)
    assert not old.exists()
    assert mine.exists()
