"""The footprint of a laser's beam: on a wall that it grazes, the part of the light that is back first is measured.

A beam of light is a narrow cone. Where it grazes a wall, the near edge of its footprint is back long before the far
one, and the range comes out short (Laconte et al., "Lidar measurement bias estimation via return waveform modelling",
ICRA 2019).
"""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Random = NDArray[np.float32]


def measured_in_footprint(range_m: Floats, incidence: Floats, divergence_rad: float, uniform: Random) -> Floats:
    """The ranges (m) that beams of `divergence_rad` measure on the planes that they meet at `range_m`.

    `incidence` is the cosine of the angle a to the plane's normal. A ray inside the cone that is b nearer to the normal
    than the middle one meets the plane at range_m cos(a) / cos(a - b); b is uniform from 0 to half of the divergence.
    """
    b = 0.5 * divergence_rad * uniform
    sine = np.sqrt(np.maximum(1.0 - incidence**2, 0.0))
    return np.asarray(range_m * incidence / np.maximum(incidence * np.cos(b) + sine * np.sin(b), 1e-9))
