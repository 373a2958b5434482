"""access_points.csv, levels.csv and coverage.csv of a radio map; the number of an access point is the same in all."""

import math
from pathlib import Path

import numpy as np

from wayfi.frontends.radio.radio_map import AccessPoint, RadioMap
from wayfi.recordings.files.atomic_files import write_csv

ACCESS_POINT_COLUMNS = [
    *("number", "bssid", "other_bssids", "standing", "x_m", "y_m", "sigma_long_m", "sigma_short_m"),
    *("cxx_m2", "cxy_m2", "cyy_m2", "readings", "places", "strongest_dbm"),
]
LEVEL_COLUMNS = ["number", "bssid", "x_m", "y_m", "level_dbm", "sigma_db"]
COVERAGE_COLUMNS = ["x_m", "y_m", "number", "bssid", "level_dbm", "sigma_db", "hole"]


def write_access_points(path: Path, radio: RadioMap) -> None:
    """Write a row for each access point. Raises OSError."""
    rows = ([str(k), *_access_point_fields(ap)] for k, ap in enumerate(radio.access_points))
    write_csv(path, ACCESS_POINT_COLUMNS, rows)


def write_levels(path: Path, radio: RadioMap) -> None:
    """Write a row for each access point and cell where its level is told. Raises OSError."""
    rows = (
        [str(k), ap.bssids[0], *_place(radio, cell), *_level(ap.level[cell], ap.sigma[cell])]
        for k, ap in enumerate(radio.access_points)
        for cell in np.flatnonzero(~np.isnan(ap.level)).tolist()
    )
    write_csv(path, LEVEL_COLUMNS, rows)


def write_coverage(path: Path, radio: RadioMap) -> None:
    """Write a row for each cell: which access point is strongest, and whether it is too weak. Raises OSError."""
    best, level, sigma = radio.best()
    holes = radio.holes()
    rows = (
        [*_place(radio, cell), *_name(radio, int(best[cell])), *_level(level[cell], sigma[cell]), str(int(holes[cell]))]
        for cell in range(len(best))
    )
    write_csv(path, COVERAGE_COLUMNS, rows)


def _access_point_fields(ap: AccessPoint) -> list[str]:
    place = [""] * 7
    if ap.xy is not None and ap.covariance is not None and ap.sigmas_m is not None:
        (cxx, cxy), (_, cyy) = ap.covariance.tolist()
        place = [f"{value:.3f}" for value in (*ap.xy.tolist(), *ap.sigmas_m, cxx, cxy, cyy)]
    heard = [str(ap.readings), str(ap.places), f"{ap.strongest_dbm:.1f}"]
    return [ap.bssids[0], " ".join(ap.bssids[1:]), ap.standing.value, *place, *heard]


def _place(radio: RadioMap, cell: int) -> list[str]:
    x, y = radio.cells.xy[cell].tolist()
    return [f"{x:.3f}", f"{y:.3f}"]


def _name(radio: RadioMap, number: int) -> list[str]:
    return [str(number), radio.access_points[number].bssids[0]] if number >= 0 else ["", ""]


def _level(level: float, sigma: float) -> list[str]:
    return ["", ""] if math.isnan(level) else [f"{level:.1f}", f"{sigma:.1f}"]
