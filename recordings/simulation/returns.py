"""The returns of a real laser: noise, glass, dark paint, edges.

A beam returns if enough of its light does, which depends on range, incidence and the face's albedo. Glass reflects only
beams at nearly a right angle, and some others. On a wall that it grazes, a beam measures a short range (footprint). A
beam at an edge may report a range between the two faces (a mixed pixel).
"""

import math

import numpy as np
from numpy.typing import NDArray

from wayfi.recordings.simulation.footprint import measured_in_footprint
from wayfi.recordings.simulation.laser import Hits, LaserSpec, Sweeps, hits, quantized
from wayfi.recordings.simulation.surfaces import Material, Surfaces

Floats = NDArray[np.float64]
Random = NDArray[np.float32]

SIGMA_M = 0.01
SIGMA_PER_M = 0.0015
ALBEDO = {Material.PLAIN: 0.6, Material.BLACK: 0.02, Material.GLASS: 1.0}
RETURN_EXPONENT = 12  # of range / reach: how sharply the share of beams that return falls near the reach
GLASS_TRANSMISSION = 0.9
MIN_GLASS_INCIDENCE = math.cos(math.radians(10.0))
EDGE_M = 0.15
DRAWS = 5  # uniform random numbers for each beam


def scans(surfaces: Surfaces, sweeps: Sweeps, spec: LaserSpec, noise: Random, uniform: Random) -> NDArray[np.float32]:
    """(n, beams) ranges (m, inf: no return) of `sweeps` with a real laser.

    `noise` (n, beams) is standard normal, `uniform` (n, DRAWS, beams) is uniform in [0, 1).
    """
    glass = surfaces.material == Material.GLASS
    on_opaque, on_glass = (hits(surfaces.where(chosen), sweeps, spec) for chosen in (~glass, glass))
    seen = _through_glass(on_opaque, on_glass, uniform[:, 0])
    measured_m = measured_in_footprint(seen.range_m, seen.incidence, spec.divergence_rad, uniform[:, 4])
    range_m = np.where(_returns(seen, spec.reach_m, uniform[:, 1]), measured_m, np.inf)
    range_m = _mixed(range_m, spec.mixed_share, uniform[:, 2], uniform[:, 3])
    sigma_m = SIGMA_M + SIGMA_PER_M * np.where(np.isfinite(range_m), range_m, 0.0)
    return quantized(range_m + noise * sigma_m, spec)


def _through_glass(opaque: Hits, glass: Hits, uniform: Random) -> Hits:
    """The hits of beams that glass reflects or transmits, given the hits on `opaque` faces and on `glass`."""
    stopped = (glass.incidence > MIN_GLASS_INCIDENCE) | (uniform >= GLASS_TRANSMISSION)
    at_glass = stopped & (glass.range_m < opaque.range_m)
    return Hits(
        np.where(at_glass, glass.range_m, opaque.range_m),
        np.where(at_glass, glass.incidence, opaque.incidence),
        np.where(at_glass, glass.material, opaque.material),
    )


def _returns(seen: Hits, reach_m: float, uniform: Random) -> NDArray[np.bool_]:
    """(n, beams) whether each beam returns."""
    albedo = np.array([ALBEDO[material] for material in Material])
    reach = reach_m * np.sqrt(albedo[seen.material] * seen.incidence)
    return np.asarray(uniform < 1.0 / (1.0 + (seen.range_m / np.maximum(reach, 1e-3)) ** RETURN_EXPONENT))


def _mixed(range_m: Floats, mixed_share: float, uniform: Random, share: Random) -> Floats:
    """`range_m` (n, beams) with mixed pixels: `mixed_share` of the beams at an edge lie between theirs and the next."""
    near, beyond = range_m[:, :-1], range_m[:, 1:]
    both = np.isfinite(near) & np.isfinite(beyond)
    step = np.subtract(beyond, near, out=np.zeros_like(near), where=both)
    mixed = (np.abs(step) > EDGE_M) & (uniform[:, :-1] < mixed_share)
    out = range_m.copy()
    out[:, :-1] += np.where(mixed, share[:, :-1] * step, 0.0)
    return out
