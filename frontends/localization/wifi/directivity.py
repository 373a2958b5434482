"""How many dB a receiver reads more of what is ahead of it than of what is behind: its antenna, or the robot's body.

The gain goes with the cosine of the bearing at which the robot sees the access point. It is learnt from places where
fingerprints face different ways: what one heading hears there more than another is linear in it. Receivers were found
to read 5 dB less of what is behind whoever carries them (Bahl and Padmanabhan, RADAR, INFOCOM 2000).
"""

import numpy as np
from numpy.typing import NDArray

from wayfi.backend.pose2 import Floats

HEADINGS = 6  # at which a scan is compared with a place; between them a cosine is interpolated to 0.13 of it
LEAST_READINGS = 200  # by which a gain is known
SURE = 5.0  # sigmas of a gain that is not chance: readings of one fingerprint err together
LEAST_DB = 1.0  # of a gain that is of use: less moves a place by less than fading does
ONE_PLACE_M = 1.0
STRONG_DBM = -78.0  # of a weaker access point one hears but what fading has lifted, and loses what it reads less

Gain = tuple[float, float]
NO_GAIN = (0.0, 0.0)


def gain_towards(gain: Gain, heading: Floats, towards: Floats) -> Floats:
    """(n,) dB that a receiver of `gain` (ahead, left) reads more of what is `towards` (n, 2), at `heading` (n,) rad."""
    return np.asarray((facing(gain, heading) * towards).sum(axis=1))


def facing(gain: Gain, heading: Floats) -> Floats:
    """(n, 2) dB that a receiver of `gain` reads more of what is in the direction of x and of y, at `heading` (n,)."""
    ahead, left = gain
    c, s = np.cos(heading), np.sin(heading)
    return np.column_stack([ahead * c - left * s, ahead * s + left * c])


def learn_gain(xy: Floats, heading: Floats, aps: NDArray[np.int32], rssi: Floats, towards: Floats) -> Gain:
    """The gain (dB ahead, dB to the left) of a receiver by its readings, (n,) each; none where it is not sure.

    They were taken at `xy` (n, 2) m, with the access point in the direction `towards` (n, 2) of them.
    """
    place = np.unique(np.floor(xy / ONE_PLACE_M), axis=0, return_inverse=True)[1].reshape(-1)
    group, count = _numbered(place, aps)
    strong = (np.bincount(group, rssi) / count)[group] > STRONG_DBM
    heading, rssi, towards = heading[strong], rssi[strong], towards[strong]
    group, count = _numbered(place[strong], aps[strong])

    def about_mean(values: Floats) -> Floats:
        return np.asarray(values - (np.bincount(group, values) / count)[group])

    left = np.column_stack([-np.sin(heading), np.cos(heading)])
    ahead = np.column_stack([np.cos(heading), np.sin(heading)])
    A = np.column_stack([about_mean((axis * towards).sum(axis=1)) for axis in (ahead, left)])
    y = about_mean(rssi)
    free = len(y) - len(count)
    information = A.T @ A
    if free < LEAST_READINGS or np.linalg.cond(information) > 1e6:
        return NO_GAIN
    gain = np.linalg.solve(information, A.T @ y)
    variance = float(((y - A @ gain) ** 2).sum()) / free
    sigmas = np.sqrt(float(gain @ information @ gain) / variance)
    known = sigmas > SURE and np.hypot(*gain) > LEAST_DB
    return (float(gain[0]), float(gain[1])) if known else NO_GAIN


def _numbered(place: NDArray[np.int64], aps: NDArray[np.int32]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """(n,) a number for each access point at each place, and how often each number stands there."""
    _, group, count = np.unique(np.column_stack([place, aps]), axis=0, return_inverse=True, return_counts=True)
    return group.reshape(-1), count
