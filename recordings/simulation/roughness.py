"""Rough walls: bumpy, partly of glass or painted black.

Smooth random fields of the position, by random Fourier features (Rahimi and Recht 2007), displace the corners of static
faces and choose their material, so that every visit sees the same.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wayfi.recordings.simulation.surfaces import Material, Surfaces

Floats = NDArray[np.float64]

BUMP_RMS_M = 0.013
BUMP_LENGTHS_M = (0.5, 4.0)
PIECE_M = 0.25
PATCH_LENGTHS_M = (4.0, 8.0)
GLASS_ABOVE = 1.8  # standard deviations: 4 % of the faces
BLACK_BELOW = -1.5  # 7 %
FEATURES = 48


@dataclass(frozen=True, slots=True, eq=False)
class Field:
    """A smooth function of the position xy: the sum of `amplitude` (f,) sqrt(2) cos(`wave` (f, 2) . xy + `phase`)."""

    amplitude: Floats
    wave: Floats
    phase: Floats

    def __call__(self, xy: Floats) -> Floats:
        """(n,) values at `xy` (n, 2)."""
        waves = np.cos(xy @ self.wave.T + self.phase) @ self.amplitude
        return np.asarray(math.sqrt(2.0) * waves)


def draw_field(rms: float, lengths_m: tuple[float, float], rng: np.random.Generator) -> Field:
    """A random field with `rms` and wavelengths in `lengths_m`; amplitudes grow with the root of the wavelength."""
    length = np.exp(rng.uniform(math.log(lengths_m[0]), math.log(lengths_m[1]), FEATURES))
    direction = rng.uniform(-np.pi, np.pi, FEATURES)
    wave = np.stack([np.cos(direction), np.sin(direction)], axis=1) * (2 * np.pi / length)[:, None]
    amplitude = np.sqrt(length / length.sum()) * rms
    return Field(amplitude, wave, rng.uniform(-np.pi, np.pi, FEATURES))


def roughened(surfaces: Surfaces, rng: np.random.Generator) -> Surfaces:
    """`surfaces` with bumps, glass and black paint on the faces that do not move."""
    bumps = [draw_field(BUMP_RMS_M, BUMP_LENGTHS_M, rng) for _ in range(2)]
    patches = draw_field(1.0, PATCH_LENGTHS_M, rng)
    pieces = _cut(surfaces)
    stays = ~pieces.moves
    corners = pieces.ends.reshape(-1, 2)
    moved = np.stack([bump(corners) for bump in bumps], axis=1).reshape(-1, 4)
    ends = pieces.ends + np.where(stays[:, None], moved, 0.0)
    middle = (pieces.ends[:, :2] + pieces.ends[:, 2:]) / 2
    material = np.where(stays, _material(patches(middle)), pieces.material)
    return Surfaces(ends, pieces.since_s, pieces.until_s, pieces.velocity_xy, material.astype(np.int8))


def _material(patch: Floats) -> NDArray[np.int64]:
    return np.select([patch > GLASS_ABOVE, patch < BLACK_BELOW], [Material.GLASS, Material.BLACK], Material.PLAIN)


def _cut(surfaces: Surfaces) -> Surfaces:
    """The faces cut into pieces of at most `PIECE_M`; moving faces are not cut."""
    along = surfaces.ends[:, 2:] - surfaces.ends[:, :2]
    pieces = np.where(surfaces.moves, 1, np.ceil(np.hypot(*along.T) / PIECE_M - 1e-9).astype(np.int64)).clip(1)
    face = np.repeat(np.arange(len(pieces)), pieces)
    number = np.arange(len(face)) - np.repeat(pieces.cumsum() - pieces, pieces)
    start, end = ((number + k) / pieces[face] for k in range(2))
    cut = [surfaces.ends[face, :2] + share[:, None] * along[face] for share in (start, end)]
    return Surfaces(
        np.hstack(cut),
        surfaces.since_s[face],
        surfaces.until_s[face],
        surfaces.velocity_xy[face],
        surfaces.material[face],
    )
