"""Writes a radio map into a folder, file by file."""

from pathlib import Path

from wayfi.backend.grid.occupancy_grid import OccupancyGrid
from wayfi.frontends.radio.radio_map import RadioMap
from wayfi.recordings.radio.geotiff import write_geotiff
from wayfi.recordings.radio.picture import write_picture
from wayfi.recordings.radio.tables import write_access_points, write_coverage, write_levels

PICTURE = "radio.png"
LEVELS, SIGMAS = "levels", "sigmas"


def write_radio_map(folder: Path, radio: RadioMap, grid: OccupancyGrid) -> None:
    """Write the tables, the GeoTIFF of the coverage and of each access point, and the picture over `grid`.

    GeoTIFF of access points that an earlier radio map had left in `folder` are deleted. Raises OSError.
    """
    for name in ("", LEVELS, SIGMAS):
        (folder / name).mkdir(parents=True, exist_ok=True)
    write_access_points(folder / "access_points.csv", radio)
    write_levels(folder / "levels.csv", radio)
    write_coverage(folder / "coverage.csv", radio)
    _write_geotiffs(folder, radio)
    write_picture(folder / PICTURE, radio, grid)


def _write_geotiffs(folder: Path, radio: RadioMap) -> None:
    _, level, sigma = radio.best()
    write_geotiff(folder / "coverage.tif", radio.cells, level, "level of the best access point, dBm")
    write_geotiff(folder / "coverage_sigma.tif", radio.cells, sigma, "its standard deviation, dB")
    names = {f"{ap.bssids[0].replace(':', '-')}.tif": ap for ap in radio.access_points}
    for kind in (LEVELS, SIGMAS):
        for old in (folder / kind).glob("??-??-??-??-??-??.tif"):
            if old.name not in names:
                old.unlink()
    for name, ap in names.items():
        write_geotiff(folder / LEVELS / name, radio.cells, ap.level, f"level of {' '.join(ap.bssids)}, dBm")
        write_geotiff(folder / SIGMAS / name, radio.cells, ap.sigma, f"standard deviation of {ap.bssids[0]}, dB")
