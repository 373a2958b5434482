"""What was heard where: a map's fingerprints gathered by place, as levels of each BSSID."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.pose2 import Floats
from wayfi.frontends.maps.building_map import BuildingMap

EPOCHS = 4  # stretches of equal length, told apart so that an access point that was moved can be noticed
LIMIT_QUANTILE = 0.1  # of all readings: about what a receiver hears every other time
LIMITS_DBM = (-95.0, -80.0)  # of any receiver


@dataclass(frozen=True, slots=True, eq=False)
class Survey:
    """(p,) places: `xy` (p, 2) m in map, the `epoch` of each, and how many fingerprints (`visits`) it has.

    `heard` (p, a) counts those that heard each of the `bssids`; `level` (p, a) dBm is their mean, NaN where none did.
    An access point below `limit_dbm` is not heard every other time. Levels are what the reference receiver would read.
    """

    xy: Floats
    epoch: NDArray[np.int64]
    visits: NDArray[np.int64]
    bssids: tuple[str, ...]
    heard: NDArray[np.float32]
    level: NDArray[np.float32]
    strongest: Floats
    limit_dbm: float


def survey(building: BuildingMap, place_m: float, floor: int = 0) -> Survey:
    """The fingerprints of a `floor` of a map, gathered where they lie within a square of `place_m`."""
    on_floor = [building.keyframes[f.keyframe].floor == floor for f in building.fingerprints]
    fingerprints = [f for f, there in zip(building.fingerprints, on_floor, strict=True) if there and f.readings.bssids]
    xy = building.fingerprint_poses()[np.flatnonzero(on_floor), :2].reshape(-1, 2)
    xy = xy[[bool(f.readings.bssids) for f, there in zip(building.fingerprints, on_floor, strict=True) if there]]
    bssids = tuple(sorted({bssid for f in fingerprints for bssid in f.readings.bssids}))
    number = {bssid: k for k, bssid in enumerate(bssids)}
    columns = np.array([number[bssid] for f in fingerprints for bssid in f.readings.bssids], np.int64)
    offsets = building.calibration.receivers
    rows = np.repeat(np.arange(len(fingerprints)), [len(f.readings.bssids) for f in fingerprints])
    levels = [f.readings.rssi - (offsets[f.receiver].offset_db if f.receiver in offsets else 0.0) for f in fingerprints]
    rssi = np.concatenate([np.zeros(0), *levels]).astype(np.float64)
    return _gathered(xy, rows, columns, rssi, bssids, place_m)


def _gathered(
    xy: Floats,
    rows: NDArray[np.int64],
    columns: NDArray[np.int64],
    rssi: Floats,
    bssids: tuple[str, ...],
    place_m: float,
) -> Survey:
    """The readings `rssi` of access points `columns` by fingerprints `rows`, which lie at `xy`, gathered by place."""
    epoch = np.arange(len(xy)) * EPOCHS // max(1, len(xy))
    keys = np.column_stack([np.floor(xy / place_m).astype(np.int64), epoch])
    places, place, visits = np.unique(keys, axis=0, return_inverse=True, return_counts=True)
    place = place.reshape(-1)
    shape = (len(places), len(bssids))
    flat = place[rows] * shape[1] + columns
    heard = np.bincount(flat, minlength=shape[0] * shape[1]).reshape(shape)
    total = np.bincount(flat, weights=rssi, minlength=shape[0] * shape[1]).reshape(shape)
    level = np.where(heard > 0, total / np.maximum(heard, 1), np.nan).astype(np.float32)
    mean_xy = np.column_stack([np.bincount(place, weights=xy[:, k], minlength=len(places)) / visits for k in range(2)])
    strongest = np.full(len(bssids), -np.inf)
    np.maximum.at(strongest, columns, rssi)
    limit = float(np.clip(np.quantile(rssi, LIMIT_QUANTILE), *LIMITS_DBM)) if len(rssi) else LIMITS_DBM[0]
    return Survey(mean_xy, places[:, 2], visits, bssids, heard.astype(np.float32), level, strongest, limit)
