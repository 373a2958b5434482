"""Walls with bumps, glass and black paint, which depend on the position alone."""

import numpy as np

from wayfi.backend.pose2 import Floats
from wayfi.recordings.simulation import laser, roughness, surfaces
from wayfi.recordings.simulation.run import start
from wayfi.recordings.simulation.surfaces import Material, Surfaces
from wayfi.recordings.simulation.worlds.blueprints import World

ROOM = surfaces.box(-3.0, -2.0, 5.0, 4.0)


def made_of(ends: Floats, material: Material) -> Surfaces:
    face = surfaces.still(ends)
    return Surfaces(
        face.ends, face.since_s, face.until_s, face.velocity_xy, np.full(len(ends), material.value, np.int8)
    )


def test_bumps_are_a_centimetre_or_two_and_smooth() -> None:
    wall = surfaces.still(np.array([[0.0, 0.0, 400.0, 0.0]]))
    rough = roughness.roughened(wall, np.random.default_rng(0)).ends
    assert 0.008 < rough[:, 1].std() < 0.02
    np.testing.assert_array_equal(rough[1:, :2], rough[:-1, 2:])
    steps = np.abs(np.diff(rough[:, 1]))
    assert np.quantile(steps, 0.99) < 0.03
    correlation = [np.corrcoef(rough[:-lag, 1], rough[lag:, 1])[0, 1] for lag in (1, 20)]
    assert correlation[0] > 0.7
    assert abs(correlation[1]) < 0.3


def test_the_same_place_is_as_rough_on_the_next_visit() -> None:
    run = start(World.OFFICE, 0, minutes=0.1)
    walls = run.surfaces.where(~run.surfaces.moves & np.isinf(run.surfaces.since_s))
    first, later = (laser.ranges(walls, np.array([[5.0, 0.0, 0.3]]), np.array([t])) for t in (1.0, 1000.0))
    np.testing.assert_array_equal(first, later)


def test_another_seed_has_other_bumps_and_what_moves_has_none() -> None:
    scene = surfaces.join([surfaces.still(ROOM), surfaces.moving(ROOM + 10.0, 0.0, 9.0, (1.0, 0.0))])
    first, other = (roughness.roughened(scene, np.random.default_rng(seed)) for seed in (1, 2))
    assert not np.array_equal(first.ends, other.ends)
    np.testing.assert_array_equal(first.ends[first.moves], ROOM + 10.0)


def test_some_walls_are_glass_some_black_in_patches_of_about_a_metre() -> None:
    wall = surfaces.still(np.array([[0.0, 0.0, 2000.0, 0.0]]))
    material = roughness.roughened(wall, np.random.default_rng(0)).material
    for kind, least, most in ((Material.GLASS, 0.01, 0.08), (Material.BLACK, 0.03, 0.12)):
        is_kind = material == kind
        patches = (np.diff(is_kind.astype(int)) == 1).sum()
        assert least < is_kind.mean() < most
        assert 0.4 < is_kind.sum() * roughness.PIECE_M / patches < 3.0
