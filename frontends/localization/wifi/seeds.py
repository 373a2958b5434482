"""Poses at which a robot of which nothing is known may be, drawn by how well a WiFi scan fits there."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.pose2 import Floats, wrap_all
from wayfi.frontends.localization.wifi.belief_config import WifiBeliefConfig
from wayfi.frontends.localization.wifi.likelihood import ScanFit
from wayfi.frontends.localization.wifi.particles import spread_evenly
from wayfi.frontends.localization.wifi.radio_places import RadioPlaces

RINGS_M = ((0.0, 1.0), (1.0, 5.0), (5.0, 10.0))  # around a place: at it, and off the ways that were driven
MOST_NATS = 50.0  # of a scan's evidence: exp() of it stays finite


@dataclass(frozen=True, slots=True, eq=False)
class Seeds:
    """(n, 3) `poses` on `floor` (n,), and their (n,) `weights` against poses drawn evenly, whose weights sum to 1."""

    poses: Floats
    floor: NDArray[np.int64]
    weights: Floats


def draw_seeds(
    places: RadioPlaces, fit: ScanFit, evidence: float, count: int, first: int, config: WifiBeliefConfig
) -> Seeds | None:
    """`count` seeds, of which the scan counts by `evidence`; None if it fits nowhere.

    `first` is the number of seeds that were drawn before: no two are alike.
    """
    if len(fit.places) == 0:
        return None
    rings, headings = len(RINGS_M), fit.log_ratio.shape[1]
    around = config.around / (rings - 1)
    prior = np.array([1.0 - config.around, *[around] * (rings - 1)]) / len(places) / headings
    ratio = np.exp(np.clip(evidence * fit.log_ratio[:, :, :rings], -MOST_NATS, MOST_NATS))
    mass = (prior * ratio).reshape(-1)
    drawn = np.minimum(np.searchsorted(np.cumsum(mass) / mass.sum(), (np.arange(count) + 0.5) / count), len(mass) - 1)
    number, heard_at, ring = np.unravel_index(drawn, ratio.shape)
    place = fit.places[number]
    cube = spread_evenly(count, 3, first)
    inner, outer = np.array(RINGS_M)[ring].T
    radius_m = np.sqrt(inner**2 + cube[:, 0] * (outer**2 - inner**2))
    bearing, heading = 2.0 * np.pi * cube[:, 1], 2.0 * np.pi / headings * (heard_at + cube[:, 2] - 0.5)
    xy = places.xy[place] + radius_m[:, None] * np.column_stack([np.cos(bearing), np.sin(bearing)])
    poses = np.column_stack([xy, wrap_all(heading)])
    return Seeds(poses, places.floor[place], mass.sum() / count / ratio.reshape(-1)[drawn])
