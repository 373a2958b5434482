"""The radio map of a building: its access points, the level of each, and what all of them cover."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.errors import WayfiError
from wayfi.backend.pose2 import Floats
from wayfi.frontends.maps.building_map import BuildingMap
from wayfi.frontends.radio.boxes import Box, boxes
from wayfi.frontends.radio.cells import Cells, cells_near
from wayfi.frontends.radio.evidence import Evidence, evidence_of
from wayfi.frontends.radio.levels import levels
from wayfi.frontends.radio.placing import Placed, place
from wayfi.frontends.radio.radio_config import RadioConfig
from wayfi.frontends.radio.survey import EPOCHS, Survey, survey

HEARD_REACH = 3.0  # times reach_m around where it was heard, the level of an access point is told
MISFIT = 1.7  # mean squared residual over which two positions are tried; of access points that stand it is 0.5 to 1
SAMPLE, LEAST_SAMPLE = 30, 5  # boxes, and the fewest of them, from which the spread of levels is learnt
SAMPLE_PLACES = 30  # where such a box is heard
SCALES = (0.5, 2.0)  # of the configured spread: beyond that something else is wrong

Bounds = tuple[Floats, Floats]


class RadioError(WayfiError):
    """A map that no radio map can be made of."""


class Standing(Enum):
    """What is known of an access point's position."""

    STANDS = "stands"
    FEW = "heard at too few places"
    MOVED = "moved: its readings contradict one position"
    CARRIED = "rides on the robot: heard alike everywhere"


@dataclass(frozen=True, slots=True, eq=False)
class AccessPoint:
    """A radio, which has one or more `bssids`, the one that is heard most first.

    `xy` (2,) m in map and `covariance` (2, 2) m^2 are None unless it is known to stand at one place. `readings` of it
    were taken at `places`. `level` (n,) dBm and `sigma` (n,) dB are at the cells of the radio map, NaN at those far
    from where it was heard.
    """

    bssids: tuple[str, ...]
    standing: Standing
    xy: Floats | None
    covariance: Floats | None
    readings: int
    places: int
    strongest_dbm: float
    level: NDArray[np.float32]
    sigma: NDArray[np.float32]

    @property
    def sigmas_m(self) -> tuple[float, float] | None:
        """One sigma along the longer and the shorter axis of the position's ellipse; None without a position."""
        if self.covariance is None:
            return None
        shorter, longer = np.sqrt(np.linalg.eigvalsh(self.covariance)).tolist()
        return longer, shorter


@dataclass(frozen=True, slots=True, eq=False)
class RadioMap:
    """The access points of a floor, and the `cells` on which their levels are told, all near where something was heard.

    Below `limit_dbm` an access point is not heard every other time; below `usable_dbm` the best of them is of no use.
    """

    access_points: tuple[AccessPoint, ...]
    cells: Cells
    limit_dbm: float
    usable_dbm: float

    def best(self) -> tuple[NDArray[np.int64], NDArray[np.float32], NDArray[np.float32]]:
        """At each cell the number of the strongest access point, its level and sigma; -1 and NaN where there is none.

        Those that were moved or ride on the robot do not count: they cover nothing tomorrow.
        """
        best = np.full(len(self.cells.xy), -1)
        level, sigma = np.full((2, len(best)), np.nan, np.float32)
        for k, ap in enumerate(self.access_points):
            if ap.standing in (Standing.STANDS, Standing.FEW):
                stronger = (ap.level > level) | (np.isnan(level) & ~np.isnan(ap.level))
                best[stronger], level[stronger], sigma[stronger] = k, ap.level[stronger], ap.sigma[stronger]
        return best, level, sigma

    def holes(self) -> NDArray[np.bool_]:
        """(n,) whether even the best level at a cell is of no use."""
        return ~(self.best()[1] >= self.usable_dbm)


def radio_map(
    building: BuildingMap,
    config: RadioConfig,
    floor: int = 0,
    progress: Callable[[float], None] = lambda _: None,
) -> RadioMap:
    """The radio map of a `floor`; `progress` is told the fraction done. Raises RadioError if nothing was heard."""
    heard = survey(building, config.place_m, floor)
    if not heard.bssids:
        raise RadioError(f"no WiFi was heard on floor {floor}: drive there with a receiver, and map again")
    cells = cells_near(heard.xy, config)
    bounds = heard.xy.min(axis=0) - config.margin_m, heard.xy.max(axis=0) + config.margin_m
    found, access_points = boxes(heard), []
    config = _calibrated(found, heard, bounds, config)
    for k, box in enumerate(found):
        access_points.append(_access_point(box, heard, bounds, cells, config))
        progress((k + 1) / len(found))
    return RadioMap(tuple(access_points), cells, heard.limit_dbm, config.usable_dbm)


def _calibrated(found: list[Box], heard: Survey, bounds: Bounds, config: RadioConfig) -> RadioConfig:
    """The settings with shadowing and fading as they are in this building.

    The scale is half way, as a ratio, from the configured spread to that of maximum likelihood, which is too sure of
    itself where shadowing is smoother than its model.
    """
    sample = [b for b in found if np.count_nonzero(b.readings) >= SAMPLE_PLACES and not _is_carried(b, heard, config)]
    misfits = [place(evidence_of(box, heard, config).heard, bounds, config).misfit for box in sample[:SAMPLE]]
    if len(misfits) < LEAST_SAMPLE:
        return config
    scale = float(np.clip(np.median(misfits) ** 0.25, *SCALES))
    return replace(
        config,
        shadow_db=scale * config.shadow_db,
        fading_db=scale * config.fading_db,
        within_place_db=scale * config.within_place_db,
    )


def _access_point(box: Box, heard: Survey, bounds: Bounds, cells: Cells, config: RadioConfig) -> AccessPoint:
    evidence = evidence_of(box, heard, config)
    standing, placed = _stand(box, heard, evidence, bounds, config)
    if standing is Standing.MOVED:
        evidence = evidence.since(evidence.latest_epoch)
    level, sigma = np.full((2, len(cells.xy)), np.nan, np.float32)
    near = cells.within(heard.xy[box.readings > 0], HEARD_REACH * config.reach_m)
    found = levels(evidence.heard, placed.likeliest if placed else None, cells.xy[near], config)
    level[near], sigma[near] = found.level, found.sigma
    xy, covariance = (placed.xy, placed.covariance) if placed else (None, None)
    readings, places = round(box.readings.sum()), int(np.count_nonzero(box.readings))
    return AccessPoint(box.bssids, standing, xy, covariance, readings, places, box.strongest_dbm, level, sigma)


def _stand(
    box: Box, heard: Survey, evidence: Evidence, bounds: Bounds, config: RadioConfig
) -> tuple[Standing, Placed | None]:
    """What is known of the position of a box, and the position if it has one."""
    if np.count_nonzero(box.readings) < config.min_places:
        return Standing.FEW, None
    if _is_carried(box, heard, config):
        return Standing.CARRIED, None
    placed = place(evidence.heard, bounds, config)
    if placed.misfit > MISFIT and _was_moved(evidence, placed, bounds, config):
        return Standing.MOVED, None
    return Standing.STANDS, placed


def _is_carried(box: Box, heard: Survey, config: RadioConfig) -> bool:
    """Whether a box is heard nearly everywhere at about one high level, though the robot went far."""
    far = np.hypot(*np.ptp(heard.xy, axis=0)) >= config.carried_path_m
    everywhere = np.mean(box.readings > 0) >= config.carried_share
    near = np.nanmedian(box.level) >= config.carried_dbm
    return bool(far and everywhere and near and np.nanstd(box.level) <= config.carried_db)


def _was_moved(evidence: Evidence, placed: Placed, bounds: Bounds, config: RadioConfig) -> bool:
    """Whether two positions, one until some time and one since, explain the readings far better than one."""
    for epoch in range(1, EPOCHS):
        before, since = evidence.before(epoch), evidence.since(epoch)
        if min(len(before.heard.xy), len(since.heard.xy)) < config.min_places:
            continue
        apart = sum(place(part.heard, bounds, config).log_evidence for part in (before, since))
        if apart > placed.log_evidence + config.moved_log_odds:
            return True
    return False
