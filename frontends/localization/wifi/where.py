"""What a scan says of poses between the places that it was compared with."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.pose2 import Floats
from wayfi.frontends.localization.wifi.likelihood import AWAY_M, ScanFit
from wayfi.frontends.localization.wifi.radio_places import RadioPlaces


class Where(NamedTuple):
    """(n,) of each pose the nearest place's row in a fit, -1 if it was not examined, and its distance (m).

    `heading` (n,) counts the headings of the fit, from 0 on.
    """

    row: NDArray[np.int64]
    distance_m: Floats
    heading: Floats

    @staticmethod
    def of(poses: Floats, floor: NDArray[np.int64], places: RadioPlaces, fit: ScanFit) -> "Where":
        """Of `poses` (n, 3) on a `floor` (n,)."""
        nearest, distance_m = places.nearest(poses[:, :2], floor)
        rows = np.full(len(places), -1, np.int64)
        rows[fit.places] = np.arange(len(fit.places))
        return Where(rows[nearest], distance_m, poses[:, 2] / (2.0 * np.pi) % 1.0 * fit.log_ratio.shape[1])


def log_ratios(fit: ScanFit, where: Where) -> Floats:
    """(n,) log ratio of poses, interpolated between the distances and the headings of the fit."""
    unexamined = np.minimum(fit.log_ratio.min(axis=0, keepdims=True, initial=0.0), 0.0)
    table = np.concatenate([fit.log_ratio, unexamined])
    k = np.clip(np.searchsorted(AWAY_M, where.distance_m, side="right") - 1, 0, len(AWAY_M) - 2)
    away = np.clip((where.distance_m - AWAY_M[k]) / (AWAY_M[k + 1] - AWAY_M[k]), 0.0, 1.0)
    before, headings = np.floor(where.heading).astype(np.int64), fit.log_ratio.shape[1]
    turned = where.heading - before
    ratio = np.zeros(len(k))
    for heading, share in ((before, 1.0 - turned), (before + 1, turned)):
        near, far = (table[where.row, heading % headings, k + side] for side in (0, 1))
        ratio += share * ((1.0 - away) * near + away * far)
    return ratio
