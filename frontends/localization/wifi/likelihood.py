"""How much more likely a WiFi scan is at a place of the map than somewhere that the map does not know.

Each access point counts by itself: at a place it is heard with the chance and the RSSI that the map tells, or it has
been changed since, by the chance `changed`. Somewhere unknown any RSSI is as likely. More access points that
the map does not know than those that it knows speak against the map. The offset of the receiver is
fitted at each place. Away from the fingerprints the map tells less and less: the sigma of RSSI grows, and the
surroundings become as good as unknown.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from wayfi.backend.pose2 import Floats
from wayfi.frontends.localization.wifi.belief_config import LikelihoodConfig
from wayfi.frontends.localization.wifi.directivity import HEADINGS, NO_GAIN, Gain, facing
from wayfi.frontends.localization.wifi.radio_places import REACH_M, RadioPlaces
from wayfi.frontends.wifi.readings import LOWEST_DBM, Readings

Ints = NDArray[np.int32]

EXAMINED = 256  # places, those that have most in common with a scan: bounds its cost
ORIENTED = 64  # of them, those that fit best, at which headings are told apart
AWAY_M = np.array([0.0, 3.0, 7.0, 12.0, REACH_M])  # from a place: the log ratios in between are interpolated
OFFSET_TURNS = 3  # of fitting an offset: the first with all readings, then without outliers
OUTLIER_SIGMAS = 2.5  # a reading that is further off does not count for the offset
STRONG_DBM = -78.0  # a receiver reports a weaker access point only where fading has lifted it
WEAK_COUNTS = 0.2  # of a strong one, for the offset
FAINT_DBM, FAINT_DB = -86.0, 3.0  # a scan misses half of the access points at this RSSI; the width of that step
UNHEARD_DBM, UNHEARD_DB = -90.0, 6.0  # an access point that the map did not hear at a place, and sigma above it
LEAST_HEARD = 0.1  # chance of an access point somewhere unknown: one that few places heard may have been moved there
ROOT_2PI = math.sqrt(2.0 * math.pi)


@dataclass(frozen=True, slots=True, eq=False)
class ScanFit:
    """How a scan that heard `known` access points of the map fits its (m,) `places`.

    `log_ratio` (m, headings, len(AWAY_M)) is against an unknown place, at and away from each, at so many headings
    evenly around the circle from 0 rad on; one if the receiver hears alike all around. `offset_db` (m, headings) is
    how much it reads above the reference if the scan was taken there, by the `common` (m, headings) access points, each
    of which counts 1 at most.
    """

    known: int
    places: NDArray[np.int64]
    log_ratio: Floats
    offset_db: Floats
    common: Floats


class _Map(NamedTuple):
    """The arrays of RadioPlaces."""

    starts: NDArray[np.int64]
    aps: Ints
    rssi: NDArray[np.float32]
    share: NDArray[np.float32]
    towards: NDArray[np.float32]
    weight: Floats
    unknown: Floats  # chance of each access point to be heard somewhere unknown


class _Model(NamedTuple):
    """Of LikelihoodConfig, and for each distance of AWAY_M the sigma of RSSI and the share that the map still tells."""

    range_db: float
    absent: float
    heard: float
    level_db: float
    sigma_db: Floats
    told: Floats


def fit_scan(
    places: RadioPlaces,
    readings: Readings,
    offset_db: float,
    sigma_db: float,
    config: LikelihoodConfig,
    gain: Gain = NO_GAIN,
    compared: NDArray[np.int64] | None = None,
) -> ScanFit:
    """Compare the readings of a receiver, whose offset is `offset_db` to `sigma_db`, with the places of the map.

    Those are the ones that have most in common with the scan, unless places `compared` are given.
    """
    of_map = places.fingerprinted
    numbers = np.array([of_map.numbers.get(bssid, -1) for bssid in readings.bssids], np.int32)
    known = numbers >= 0
    aps, rssi = numbers[known], readings.rssi[known] - np.float32(offset_db)
    weight = of_map.weight[aps]
    found = compared
    if found is None:
        order = np.argsort(-weight * (rssi - LOWEST_DBM), kind="stable")
        found = places.postings.overlap(aps[order], rssi[order], weight[order], len(places), EXAMINED).numbers
    level = np.full(len(of_map.weight), np.nan)
    level[aps] = rssi
    unknown = np.clip(config.unknown_heard * places.common, LEAST_HEARD, config.unknown_heard)
    heard = _Map(*places.heard, places.towards, of_map.weight, unknown)
    model = _model(config)

    def fitted(chosen: NDArray[np.int64], more_db: Floats) -> tuple[Floats, Floats]:
        log_ratio, offsets = np.zeros((len(chosen), len(AWAY_M))), np.zeros((len(chosen), 2))
        _fit(log_ratio, offsets, chosen, heard, level, aps, model, sigma_db, more_db)
        return log_ratio, offsets

    log_ratio, offsets = (np.expand_dims(values, 1) for values in fitted(found, np.zeros(2)))
    if gain != NO_GAIN:
        best = np.argsort(-log_ratio[:, 0, 0], kind="stable")[:ORIENTED]
        log_ratio, offsets = np.repeat(log_ratio, HEADINGS, 1), np.repeat(offsets, HEADINGS, 1)
        for k, more_db in enumerate(facing(gain, np.arange(HEADINGS) * 2.0 * np.pi / HEADINGS)):
            log_ratio[best, k], offsets[best, k] = fitted(found[best], more_db)
    log_ratio += config.new_nats * min(2.0 * len(aps) - len(known), 0.0) * model.told / model.told[0]
    return ScanFit(len(aps), found, log_ratio, offset_db + offsets[..., 0], offsets[..., 1])


def evidence_of_scan(known: int, moved_m: float, config: LikelihoodConfig) -> float:
    """The share of its log ratio that a scan counts, of `known` access points, so far on from the last one."""
    new = min(moved_m / config.independent_m, 1.0)
    return max(new, config.standing) / (config.siblings + known / config.independent_aps)


def _model(config: LikelihoodConfig) -> _Model:
    sigma_db = np.hypot(config.level_db, config.gradient_db_per_m * AWAY_M)
    told = (1.0 - config.changed) * (1.0 - AWAY_M / REACH_M)
    return _Model(config.range_db, config.absent, config.heard, config.level_db, sigma_db, told)


@njit(cache=True)
def _fit(
    log_ratio: Floats,
    offsets: Floats,
    found: NDArray[np.int64],
    heard: _Map,
    level: Floats,
    in_scan: Ints,
    model: _Model,
    sigma_db: float,
    more_db: Floats,
) -> None:
    """Fill `log_ratio` (m, distances), and `offsets` (m, 2): the offset by the readings alone, and their number.

    `level` (access points,) is the RSSI in the scan, NaN where it is missing; `in_scan` are those that are not.
    `more_db` (2,) are read more of what is in the direction of x, and of y.
    """
    rssi = np.empty(len(level))
    at_place = np.zeros(len(level), np.bool_)
    for m in range(len(found)):
        first, end = heard.starts[found[m]], heard.starts[found[m] + 1]
        for i in range(first, end):
            a = heard.aps[i]
            at_place[a] = True
            rssi[a] = heard.rssi[i] + more_db[0] * heard.towards[i, 0] + more_db[1] * heard.towards[i, 1]
        at = heard.aps[first:end]
        offset, offsets[m, 0], offsets[m, 1] = _offset(at, rssi, heard, level, model, sigma_db)
        for i in range(first, end):
            a = heard.aps[i]
            if math.isnan(level[a]):
                loud = 1.0 / (1.0 + math.exp((FAINT_DBM - rssi[a] - offset) / FAINT_DB))
                missed = (1.0 - model.heard * heard.share[i] * loud) / (1.0 - heard.unknown[a])
                _add(log_ratio[m], missed, heard.weight[a], model)
            else:
                chance = max(model.heard * heard.share[i], model.absent) * model.range_db / heard.unknown[a]
                _add_heard(log_ratio[m], level[a] - rssi[a] - offset, chance, heard.weight[a], model)
        for a in in_scan:
            if not at_place[a]:
                above = max(level[a] - offset - UNHEARD_DBM, 0.0) / UNHEARD_DB
                density = math.exp(-0.5 * above * above) / (UNHEARD_DB * ROOT_2PI)
                _add(log_ratio[m], model.absent * density * model.range_db / heard.unknown[a], heard.weight[a], model)
        at_place[at] = False


@njit(cache=True)
def _add(log_ratio: Floats, ratio: float, weight: float, model: _Model) -> None:
    """Add an access point that is `ratio` times as likely at the place as somewhere unknown, at any distance."""
    for k in range(len(log_ratio) - 1):  # at the last the map tells nothing
        log_ratio[k] += weight * math.log(model.told[k] * ratio + 1.0 - model.told[k])


@njit(cache=True)
def _add_heard(log_ratio: Floats, difference_db: float, chance: float, weight: float, model: _Model) -> None:
    """Add one that reads `difference_db` above the map's RSSI."""
    for k in range(len(log_ratio) - 1):  # at the last the map tells nothing
        d = difference_db / model.sigma_db[k]
        ratio = chance * math.exp(-0.5 * d * d) / (model.sigma_db[k] * ROOT_2PI)
        log_ratio[k] += weight * math.log(model.told[k] * ratio + 1.0 - model.told[k])


@njit(cache=True)
def _offset(
    at: Ints, rssi: Floats, heard: _Map, level: Floats, model: _Model, sigma_db: float
) -> tuple[float, float, float]:
    """The receiver's further offset at a place by prior and readings, by the readings alone, and their number.

    The access points `at` the place have `rssi` (access points,) there.
    """
    offset, raw, common = 0.0, 0.0, 0.0
    prior = (model.level_db / sigma_db) ** 2
    for turn in range(OFFSET_TURNS):
        total, common = 0.0, 0.0
        for a in at:
            d = level[a] - rssi[a]
            if not math.isnan(d) and (turn == 0 or abs(d - offset) < OUTLIER_SIGMAS * model.level_db):
                strong = level[a] + rssi[a] > 2.0 * STRONG_DBM
                counts = heard.weight[a] * (1.0 if strong else WEAK_COUNTS)
                total += counts * d
                common += counts
        offset = total / (common + prior)
        raw = total / common if common > 0.0 else 0.0
    return offset, raw, common
