"""The returns of a real laser: noise, glass, dark paint, edges.

A beam returns if enough of its light does, which depends on range, incidence and the face's albedo. Glass reflects only
beams at nearly a right angle, and some others. On a wall that it grazes, a beam measures a short range (footprint). A
beam at an edge may report a range between the two faces (a mixed pixel).
"""

import math

import numpy as np
from numpy.typing import NDArray

from wayfi.recordings.simulation.footprint import shortened_m
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
SLANT_STEPS = 2.0  # of the step on a plane of the same slant: walls are not quite even
DRAWS = 4  # uniform random numbers for each beam


def scans(surfaces: Surfaces, sweeps: Sweeps, spec: LaserSpec, noise: Random, uniform: Random) -> NDArray[np.float32]:
    """(n, beams) ranges (m, inf: no return) of `sweeps` with a real laser.

    `noise` (n, beams) is standard normal, `uniform` (n, DRAWS, beams) is uniform in [0, 1).
    """
    glass = surfaces.material == Material.GLASS
    on_opaque, on_glass = (hits(surfaces.where(chosen), sweeps, spec) for chosen in (~glass, glass))
    seen = _through_glass(on_opaque, on_glass, uniform[:, 0])
    measured_m = seen.range_m - shortened_m(seen.range_m, seen.incidence, spec.divergence_rad)
    range_m = np.where(_returns(seen, spec.reach_m, uniform[:, 1]), measured_m, np.inf)
    edges = _edges(range_m, seen.incidence, spec.angle_increment) & (uniform[:, 2, :-1] < spec.mixed_share)
    range_m = _mixed(range_m, edges, uniform[:, 3, :-1])
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


def _edges(range_m: Floats, incidence: Floats, increment: float) -> NDArray[np.bool_]:
    """(n, beams - 1) whether the range leaps from a beam to the next, by more than on a wall that the beams graze."""
    returns = np.isfinite(range_m)
    known_m = np.where(returns, range_m, 0.0)
    on_wall_m = known_m * increment * np.sqrt(np.maximum(1.0 - incidence**2, 0.0)) / np.maximum(incidence, 1e-3)
    allowed_m = EDGE_M + SLANT_STEPS * np.maximum(on_wall_m[:, :-1], on_wall_m[:, 1:])
    return (np.abs(np.diff(known_m)) > allowed_m) & returns[:, :-1] & returns[:, 1:]


def _mixed(range_m: Floats, edges: NDArray[np.bool_], share: Random) -> Floats:
    """`range_m` (n, beams) with mixed pixels at `edges` (n, beams - 1): one of the two beams measures in between.

    Either is as likely, and the range as likely anywhere between the two, by `share` (n, beams - 1) in [0, 1).
    """
    step_m = np.subtract(range_m[:, 1:], range_m[:, :-1], out=np.zeros(edges.shape), where=edges)
    out = range_m.copy()
    out[:, :-1] += np.where(share < 0.5, 2.0 * share * step_m, 0.0)
    out[:, 1:] -= np.where(share < 0.5, 0.0, (2.0 * share - 1.0) * step_m)
    return out
