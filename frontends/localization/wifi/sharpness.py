"""How much more a scan counts between places of a map than its evidence says: learnt from the map's own scans.

The readings of a scan err together, and so do scans one after the other: what they say of a place is a power of the
product of their likelihoods (a composite likelihood; Ribatet et al., Statistica Sinica 2012). The power is that by
which the true ways are likeliest among those beside them, in the places that other passes have left.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.pose2 import Floats
from wayfi.frontends.localization.wifi.belief_config import WifiBeliefConfig
from wayfi.frontends.localization.wifi.likelihood import evidence_of_scan, fit_scan
from wayfi.frontends.localization.wifi.radio_places import Fingerprinted, RadioPlaces, places_of_some
from wayfi.frontends.localization.wifi.where import Where, log_ratios
from wayfi.frontends.maps.building_map import BuildingMap
from wayfi.frontends.wifi.readings import Readings

Longs = NDArray[np.int64]

WAY_M = 8.0  # of path, whose scans are tried together: shadowing is new after 2 to 4 m
FOLDS = 6  # each way is tried in the places of the others of so many
MOST_WAYS = 40  # tried, evenly drawn: bounds the cost to a second
LEAST_WAYS = 10  # by which the power is told: fewer are of one or two stretches, that all fit well or badly
LEAST_SCANS = 3  # on a way
NEAR_M, MOSTLY = 1.0, 0.8  # from a place that other passes have left, and so many of the scans
BESIDE_M, STEP_M = 4.0, 0.5  # how far beside it a way is tried, and in which steps
POWERS = np.geomspace(0.5, 16.0, 61)
PRIOR = 0.5  # sigma of its logarithm about the configured one


def learn_sharpness(building: BuildingMap, places: RadioPlaces, config: WifiBeliefConfig) -> float:
    """The power by the `places` of a map; that of `config` where too few of its ways were driven twice."""
    ways = list(_ways(building, places.fingerprinted, config))
    if len(ways) < LEAST_WAYS:
        return config.within_map
    log_likelihood = -0.5 * (np.log(POWERS / config.within_map) / PRIOR) ** 2
    for ratio in ways:
        powered = POWERS[:, None] * ratio
        top = powered.max(axis=1, keepdims=True)
        log_likelihood -= top[:, 0] + np.log(np.exp(powered - top).sum(axis=1))
    return float(POWERS[np.argmax(log_likelihood)])


def _ways(building: BuildingMap, known: Fingerprinted, config: WifiBeliefConfig) -> Iterator[Floats]:
    """Of each way that is tried the log ratios (n,) of being beside where it was, on ways of the map."""
    path_m = np.array([f.path_m for f in building.fingerprints])
    session = np.array([building.keyframes[f.keyframe].session for f in building.fingerprints])
    numbers = np.column_stack([session, np.floor(path_m / WAY_M)]).astype(np.int64)
    way = np.unique(numbers, axis=0, return_inverse=True)[1].reshape(-1)
    for fold in range(FOLDS):
        places = places_of_some(known, np.flatnonzero(way % FOLDS != fold), config.likelihood)
        xy = building.fingerprint_poses()[:, :2]
        _, distance_m = places.nearest(xy, known.floor)
        near = np.bincount(way, distance_m < NEAR_M) / np.maximum(np.bincount(way), 1)
        tried = np.flatnonzero((near >= MOSTLY) & (np.bincount(way) >= LEAST_SCANS))
        tried = tried[tried % FOLDS == fold]
        for number in tried[:: max(1, -(-len(tried) * FOLDS // MOST_WAYS))]:
            scans = np.flatnonzero(way == number)
            yield _beside(scans[np.argsort(path_m[scans])], path_m, xy, known, places, config)


def _beside(
    scans: Longs, path_m: Floats, xy: Floats, known: Fingerprinted, places: RadioPlaces, config: WifiBeliefConfig
) -> Floats:
    """The log ratios of one way, the fingerprints `scans` (k,) in their order."""
    shifts = _shifts()
    names, total, near = list(known.numbers), np.zeros(len(shifts)), np.zeros(len(shifts))
    moved_m = np.diff(path_m[scans], prepend=path_m[scans[0]] - STEP_M)
    for k, step_m in zip(scans, moved_m.tolist(), strict=True):
        heard = slice(known.heard.starts[k], known.heard.starts[k + 1])
        rssi = known.heard.rssi[heard]
        readings = Readings(tuple(names[a] for a in known.heard.aps[heard]), rssi, np.zeros_like(rssi))
        poses = np.column_stack([xy[k] + shifts, np.zeros(len(shifts))])
        floor = np.full(len(shifts), known.floor[k])
        nearest, distance_m = places.nearest(poses[:, :2], floor)
        sigma_db = config.likelihood.known_offset_db
        fit = fit_scan(places, readings, 0.0, sigma_db, config.likelihood, compared=np.unique(nearest))
        ratio = log_ratios(fit, Where.of(poses, floor, places, fit))
        near += distance_m < NEAR_M
        total += evidence_of_scan(fit.known, step_m, config.likelihood) * (ratio - ratio[len(shifts) // 2])
    return total[near >= MOSTLY * len(scans)]


def _shifts() -> Floats:
    """(n, 2) m, on a square lattice around none."""
    axis = np.arange(-BESIDE_M, BESIDE_M + STEP_M / 2, STEP_M)
    return np.stack(np.meshgrid(axis, axis, indexing="ij"), axis=-1).reshape(-1, 2)
