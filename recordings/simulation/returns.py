"""What a real laser makes of what its beams meet: noise, glass, dark paint, edges.

A beam comes back if enough of its light does: that falls with the square of the range and with the cosine of the
incidence, and is a matter of the face's albedo. Glass lets most beams through unless they meet it at nearly a right
angle. A beam that meets two faces at an edge may report a range between the two (a mixed pixel).
"""

import math

import numpy as np
from numpy.typing import NDArray

from wayfi.recordings.simulation.laser import Hits, LaserSpec, Sweeps, hits, reported
from wayfi.recordings.simulation.surfaces import Material, Surfaces

Floats = NDArray[np.float64]
Random = NDArray[np.float32]

SIGMA_M = 0.01
SIGMA_PER_M = 0.0015
ALBEDO = {Material.PLAIN: 0.6, Material.BLACK: 0.02, Material.GLASS: 1.0}
FADING = 12  # how sharply the share of beams that come back falls around the reach: its power of range / reach
THROUGH_GLASS = 0.9
GLASS_RETURNS_WITHIN = math.cos(math.radians(10.0))
EDGE_M = 0.15
MIXED = 0.15
LUCK = 4  # uniform numbers a beam


def scans(surfaces: Surfaces, sweeps: Sweeps, spec: LaserSpec, noise: Random, luck: Random) -> NDArray[np.float32]:
    """(n, beams) ranges (m, inf for no return) that a real laser reports of `sweeps`.

    `noise` (n, beams) is normal, `luck` (n, LUCK, beams) is uniform in [0, 1).
    """
    glass = surfaces.material == Material.GLASS
    seen = _first(hits(surfaces.where(~glass), sweeps, spec), hits(surfaces.where(glass), sweeps, spec), luck[:, 0])
    range_m = np.where(_comes_back(seen, spec.reach_m, luck[:, 1]), seen.range_m, np.inf)
    range_m = _mixed(range_m, luck[:, 2], luck[:, 3])
    sigma_m = SIGMA_M + SIGMA_PER_M * np.where(np.isfinite(range_m), range_m, 0.0)
    return reported(range_m + noise * sigma_m, spec)


def _first(opaque: Hits, glass: Hits, luck: Random) -> Hits:
    """What a beam meets that goes through glass, or does not."""
    stopped = (glass.incidence > GLASS_RETURNS_WITHIN) | (luck >= THROUGH_GLASS)
    at_glass = stopped & (glass.range_m < opaque.range_m)
    return Hits(
        np.where(at_glass, glass.range_m, opaque.range_m),
        np.where(at_glass, glass.incidence, opaque.incidence),
        np.where(at_glass, glass.material, opaque.material),
    )


def _comes_back(seen: Hits, reach_m: float, luck: Random) -> NDArray[np.bool_]:
    """Whether enough light of each beam does."""
    albedo = np.array([ALBEDO[material] for material in Material])
    reach = reach_m * np.sqrt(albedo[seen.material] * seen.incidence)
    return np.asarray(luck < 1.0 / (1.0 + (seen.range_m / np.maximum(reach, 1e-3)) ** FADING))


def _mixed(range_m: Floats, luck: Random, share: Random) -> Floats:
    """`range_m` (n, beams) where some beams that end beside an edge report a range between theirs and the next."""
    near, beyond = range_m[:, :-1], range_m[:, 1:]
    both = np.isfinite(near) & np.isfinite(beyond)
    step = np.subtract(beyond, near, out=np.zeros_like(near), where=both)
    mixed = (np.abs(step) > EDGE_M) & (luck[:, :-1] < MIXED)
    out = range_m.copy()
    out[:, :-1] += np.where(mixed, share[:, :-1] * step, 0.0)
    return out
