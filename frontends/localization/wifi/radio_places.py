"""The places of a map as WiFi hears them: the mean of the fingerprints around each square metre that was driven."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from wayfi.backend.pose2 import Floats
from wayfi.frontends.lidar.point_index import CellGrid, block_around, nearest, sort_by_cell
from wayfi.frontends.localization.wifi.belief_config import LikelihoodConfig
from wayfi.frontends.localization.wifi.directions import Directions, directions
from wayfi.frontends.localization.wifi.directivity import NO_GAIN, Gain, gain_towards, learn_gain
from wayfi.frontends.localization.wifi.heard import Heard
from wayfi.frontends.localization.wifi.level_spread import LevelSpread, learn_spread
from wayfi.frontends.maps.building_map import BuildingMap, MapFingerprint
from wayfi.frontends.wifi.postings import Postings

Ints = NDArray[np.int32]
Longs = NDArray[np.int64]
Levels = NDArray[np.float32]

FLOOR_M = 1e4  # along x between floors, so that one index finds the nearest place of the same floor
REACH_M = 18.0  # from a place: further away the map tells nothing of WiFi
SMOOTHED = 2.0  # sigmas: fingerprints further away add less than a seventh
STEP_DB = 8.0  # of the posting lists: two steps apart cover the offset of another phone


class Fingerprinted(NamedTuple):
    """What the fingerprints of a map `heard` `at` (m, 2) m on a `floor` (m,), less the receivers' offsets and `gains`.

    Different floors lie far apart; `around` gives the directions of access points. Of each of these: its number by its
    BSSID, and the `weight` (0 to 1) by which it counts. `spread` is that of readings about what was heard.
    """

    at: Floats
    floor: Longs
    heard: Heard
    around: Directions
    gains: Mapping[str, Gain]
    numbers: Mapping[str, int]
    weight: Floats
    spread: LevelSpread


@dataclass(frozen=True, slots=True, eq=False)
class RadioPlaces:
    """(n, 2) m `xy` in map and (n,) `floor` of each place, and what was `heard` there of what was `fingerprinted`.

    `towards` (entries of `heard`, 2) is the mean direction of the access point from the place; `common` is the share of
    all places where each was heard.
    """

    xy: Floats
    floor: Longs
    heard: Heard
    towards: Levels
    common: Floats
    postings: Postings
    fingerprinted: Fingerprinted
    _sorted: Floats
    _order: Longs
    _cells: CellGrid

    def __len__(self) -> int:
        return len(self.xy)

    def nearest(self, xy: Floats, floor: Longs) -> tuple[Longs, Floats]:
        """(m,) number of the place nearest to each of `xy` (m, 2) on its floor, and its distance (m,) in m.

        Of those further than REACH_M from any, number 0 and infinity.
        """
        row, distance_m = _nearest(_by_floor(xy, floor), self._sorted, self._cells)
        return np.where(row >= 0, self._order[row], 0), distance_m


def radio_places(building: BuildingMap, config: LikelihoodConfig) -> RadioPlaces | None:
    """The places of a map; None if it has no fingerprints."""
    fingerprints = building.fingerprints
    if not fingerprints:
        return None
    floor = np.array([building.keyframes[f.keyframe].floor for f in fingerprints], np.int64)
    at = _by_floor(building.fingerprint_poses()[:, :2], floor)
    numbers: dict[str, int] = {}
    offsets = {receiver: known.offset_db for receiver, known in building.calibration.receivers.items()}
    heard = _heard(fingerprints, offsets, numbers)
    around = directions(at, floor, heard, len(numbers))
    gains, heard = _less_gains(building, heard, around.seen_from(np.arange(len(at)), heard))
    weight = np.array([building.weights.get(bssid, 1.0) for bssid in numbers])
    weight = np.minimum(weight / np.median(weight), 1.0)
    spread = learn_spread(at, heard, config)
    known = Fingerprinted(at, floor, heard, around, gains, numbers, weight, spread)
    return places_of_some(known, np.arange(len(at)), config)


def places_of_some(known: Fingerprinted, kept: Longs, config: LikelihoodConfig) -> RadioPlaces:
    """The places of the fingerprints `kept` (k,) alone, by their numbers."""
    at = known.at[kept]
    _, first, cell = np.unique(np.floor(at / config.place_m), axis=0, return_index=True, return_inverse=True)
    cell = cell.reshape(-1)
    places = np.column_stack([np.bincount(cell, at[:, axis]) for axis in (0, 1)]) / np.bincount(cell)[:, None]
    heard = _smoothed(places, known, kept, config.smoothing_m)
    floor, common = known.floor[kept[first]], np.bincount(heard.aps, minlength=len(known.numbers)) / len(places)
    order, cells = sort_by_cell(places, REACH_M)
    return RadioPlaces(
        places - np.column_stack([floor * FLOOR_M, np.zeros(len(first))]), floor, heard,
        known.around.seen_from(kept[first], heard), common, _posted(heard), known, places[order], order, cells,
    )  # fmt: skip


def _by_floor(xy: Floats, floor: Longs) -> Floats:
    return np.column_stack([xy[:, 0] + FLOOR_M * floor, xy[:, 1]])


def _heard(fingerprints: Sequence[MapFingerprint], offsets: Mapping[str, float], numbers: dict[str, int]) -> Heard:
    """What each fingerprint heard; numbers the access points."""
    aps = [numbers.setdefault(bssid, len(numbers)) for f in fingerprints for bssid in f.readings.bssids]
    rssi = np.concatenate([f.readings.rssi - np.float32(offsets.get(f.receiver, 0.0)) for f in fingerprints])
    starts = np.cumsum([0, *(len(f.readings.bssids) for f in fingerprints)])
    return Heard(starts.astype(np.int64), np.array(aps, np.int32), rssi, np.ones(len(aps), np.float32))


def _less_gains(building: BuildingMap, heard: Heard, towards: Levels) -> tuple[dict[str, Gain], Heard]:
    """The gain of each receiver, learnt from what its fingerprints `heard`, and that less the gains."""
    rows, poses = heard.rows(), building.fingerprint_poses()[heard.rows()]
    receiver = np.array([f.receiver for f in building.fingerprints])[rows]
    gains: dict[str, Gain] = {}
    rssi = heard.rssi.copy()
    for name in sorted(set(receiver.tolist())):
        own = receiver == name
        x, y, heading = poses[own].T
        gain = learn_gain(np.column_stack([x, y]), heading, heard.aps[own], heard.rssi[own], towards[own])
        rssi[own] -= gain_towards(gain, heading, towards[own]).astype(np.float32)
        gains |= {name: gain} if gain != NO_GAIN else {}
    return gains, heard._replace(rssi=rssi)


def _smoothed(places: Floats, known: Fingerprinted, kept: Longs, sigma_m: float) -> Heard:
    """The mean at each of `places` (n, 2) m of the fingerprints `kept` around."""
    order, cells = sort_by_cell(known.at[kept], SMOOTHED * sigma_m)
    order = kept[order]
    counts, aps, rssi, share = _means(places, known.at[order], order, cells, known.heard, len(known.numbers), sigma_m)
    return Heard(np.concatenate([[0], np.cumsum(counts)]), aps, rssi, share)


@njit(cache=True)
def _means(
    places: Floats, at: Floats, order: Longs, cells: CellGrid, heard: Heard, access_points: int, sigma_m: float
) -> tuple[Longs, Ints, Levels, Levels]:
    """For each place how many access points were heard, and of all of them the number, mean RSSI and share."""
    weights, sums = np.zeros(access_points), np.zeros(access_points)
    counts = np.zeros(len(places), np.int64)
    aps = [np.int32(0) for _ in range(0)]
    rssi = [np.float32(0) for _ in range(0)]
    share = [np.float32(0) for _ in range(0)]
    for p in range(len(places)):
        total = 0.0
        met = [np.int32(0) for _ in range(0)]
        top, bottom, left, right = block_around(places[p, 0], places[p, 1], cells)
        for r in range(top, bottom):
            for k in range(cells.starts[r * cells.columns + left], cells.starts[r * cells.columns + right]):
                d2 = (at[k, 0] - places[p, 0]) ** 2 + (at[k, 1] - places[p, 1]) ** 2
                weight = np.exp(-0.5 * d2 / sigma_m**2)
                total += weight
                for i in range(heard.starts[order[k]], heard.starts[order[k] + 1]):
                    a = heard.aps[i]
                    if weights[a] == 0.0:
                        met.append(a)
                    weights[a] += weight
                    sums[a] += weight * heard.rssi[i]
        for a in met:
            aps.append(a)
            rssi.append(np.float32(sums[a] / weights[a]))
            share.append(np.float32(weights[a] / total))
            weights[a], sums[a] = 0.0, 0.0
        counts[p] = len(met)
    return counts, np.array(aps), np.array(rssi), np.array(share)


@njit(cache=True)
def _nearest(at: Floats, points: Floats, cells: CellGrid) -> tuple[Longs, Floats]:
    rows, distance_m = np.empty(len(at), np.int64), np.empty(len(at))
    for m in range(len(at)):
        row = nearest(at[m, 0], at[m, 1], REACH_M, points, cells)
        rows[m] = row
        distance_m[m] = np.hypot(points[row, 0] - at[m, 0], points[row, 1] - at[m, 1]) if row >= 0 else np.inf
    return rows, distance_m


def _posted(heard: Heard) -> Postings:
    postings = Postings(STEP_DB)
    for place in range(len(heard.starts) - 1):
        span = slice(heard.starts[place], heard.starts[place + 1])
        postings.add(place, heard.aps[span], heard.rssi[span])
    return postings
