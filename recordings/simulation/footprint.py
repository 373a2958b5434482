"""The footprint of a laser's beam: a wall that it grazes returns a long pulse, and the range comes out short.

A beam of light is a narrow cone. On a slanted wall its footprint spreads along the beam, which lengthens the pulse that
comes back. The laser takes the moment at which the pulse has risen to half of its height (Laconte et al., "Lidar
measurement bias estimation via return waveform modelling in a context of 3D mapping", ICRA 2019).
"""

import math

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

PULSE_M = 0.25  # sigma of a pulse of 4 ns at half of its height, in range
HALF_HEIGHT = math.sqrt(2 * math.log(2))  # sigmas from the middle of a normal pulse to half of its height
LEAST_INCIDENCE = 0.01  # cosine: a beam that is nearer to parallel meets bumps, not the plane


def shortened_m(range_m: Floats, incidence: Floats, divergence_rad: float) -> Floats:
    """How much too short (m) beams of `divergence_rad` measure walls at `range_m`; 0 where there is none.

    `incidence` is the cosine of the angle to the wall's normal.
    """
    cosine = np.maximum(incidence, LEAST_INCIDENCE)
    slope = np.sqrt(np.maximum(1.0 - cosine**2, 0.0)) / cosine
    spread_m = np.where(np.isfinite(range_m), range_m, 0.0) * divergence_rad * slope / math.sqrt(12)
    return np.asarray(HALF_HEIGHT * (np.hypot(PULSE_M, spread_m) - PULSE_M))
