"""Noise, glass, black paint and edges in the returns of a real laser."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from wayfi.backend.pose2 import Floats
from wayfi.recordings.simulation import laser, returns, surfaces
from wayfi.recordings.simulation.laser import UST_20LX, LaserSpec
from wayfi.recordings.simulation.surfaces import Material, Surfaces

ROOM = surfaces.box(-3.0, -2.0, 5.0, 4.0)


def made_of(ends: Floats, material: Material) -> Surfaces:
    face = surfaces.still(ends)
    return Surfaces(
        face.ends, face.since_s, face.until_s, face.velocity_xy, np.full(len(ends), material.value, np.int8)
    )


def facing(distance_m: float, half_width_m: float, material: Material) -> Surfaces:
    """A face across the x axis."""
    return made_of(np.array([[distance_m, -half_width_m, distance_m, half_width_m]]), material)


def seen(scene: Surfaces, count: int = 200, seed: int = 0, spec: LaserSpec = UST_20LX) -> NDArray[np.float32]:
    """(count, beams) what a laser at rest at the origin, looking along x, reports."""
    rng, shape = np.random.default_rng(seed), (count, UST_20LX.beams)
    sweeps = laser.instant_sweeps(np.zeros((count, 3)), np.zeros(count))
    luck = rng.random((count, returns.DRAWS, shape[1]), dtype=np.float32)
    return returns.scans(scene, sweeps, spec, rng.standard_normal(shape, dtype=np.float32), luck)


def beams_at(degrees: float) -> int:
    return round((math.radians(degrees) - UST_20LX.angle_min) / UST_20LX.angle_increment)


def test_noise_grows_with_the_range() -> None:
    sigmas = {}
    for distance_m in (1.0, 8.0, 16.0):
        error = seen(facing(distance_m, 0.5, Material.PLAIN))[:, beams_at(0.0)] - distance_m
        assert abs(error.mean()) < 0.01
        sigmas[distance_m] = float(error.std())
    assert sigmas[1.0] == pytest.approx(0.0115, rel=0.2)
    assert sigmas[8.0] > 1.5 * sigmas[1.0]
    assert sigmas[16.0] > 1.2 * sigmas[8.0]


def test_glass_is_seen_at_a_right_angle_and_through_elsewhere() -> None:
    scene = surfaces.join([facing(2.0, 8.0, Material.GLASS), facing(6.0, 20.0, Material.PLAIN)])
    across = np.abs(seen(scene)[:, beams_at(-5.0) : beams_at(5.0)] - 2.0) < 0.1
    assert across.mean() > 0.98
    range_m = seen(scene)[:, beams_at(30.0) : beams_at(50.0)]
    along_x = range_m * np.cos(UST_20LX.bearings[beams_at(30.0) : beams_at(50.0)])
    assert 0.8 < (np.abs(along_x - 6.0) < 0.2).mean() < 0.95
    assert 0.05 < (np.abs(along_x - 2.0) < 0.2).mean() < 0.2


def test_glass_with_nothing_behind_it_returns_little() -> None:
    oblique = seen(facing(2.0, 8.0, Material.GLASS))[:, beams_at(30.0) : beams_at(50.0)]
    assert 0.8 < np.isinf(oblique).mean() < 0.97


def share_back(distance_m: float, degrees: float, material: Material) -> float:
    """How many beams come back from a face that they meet at `distance_m` and `degrees` off the right angle."""
    at = math.radians(degrees)
    along = np.array([math.sin(at), math.cos(at)]) * 0.5
    face = np.array([[distance_m - along[0], -along[1], distance_m + along[0], along[1]]])
    return float(np.isfinite(seen(made_of(face, material))[:, beams_at(0.0)]).mean())


def test_black_paint_is_lost_far_away_and_when_grazed() -> None:
    assert share_back(3.0, 0.0, Material.BLACK) > 0.95
    assert share_back(15.0, 0.0, Material.BLACK) < 0.05
    assert share_back(5.0, 80.0, Material.BLACK) < 0.1
    assert share_back(15.0, 0.0, Material.PLAIN) > 0.95
    assert share_back(5.0, 80.0, Material.PLAIN) > 0.95


def test_edges_mix_pixels_and_flat_walls_do_not() -> None:
    wall = facing(5.0, 1.0, Material.PLAIN)
    edge = surfaces.join([wall, made_of(np.array([[3.0, -0.5, 3.0, 0.0]]), Material.PLAIN)])
    near = slice(beams_at(-2.0), beams_at(2.0))
    between = (seen(edge)[:, near] > 3.15) & (seen(edge)[:, near] < 4.85)
    assert 0.07 < between.any(axis=1).mean() < 0.2
    assert not ((seen(wall)[:, near] < 4.85) | (seen(wall)[:, near] > 5.15)).any()


def grazing(degrees: float) -> Surfaces:
    """A wall to the right, which the beam `degrees` from it meets at 5 m."""
    aside_m = 5.0 * math.sin(math.radians(degrees))
    return made_of(np.array([[-30.0, -aside_m, 60.0, -aside_m]]), Material.PLAIN)


def test_a_grazed_wall_comes_out_short_and_one_seen_straight_does_not() -> None:
    wide = replace(UST_20LX, divergence_rad=0.01, reach_m=1e3)
    for degrees, least_m, most_m in ((90.0, 0.0, 0.003), (30.0, 0.0, 0.005), (5.0, 0.03, 0.2)):
        beam = beams_at(-degrees)
        short_m = 5.0 - seen(grazing(degrees), spec=wide)[:, beam].mean()
        assert least_m - 0.003 <= short_m <= most_m
        assert abs(5.0 - seen(grazing(degrees))[:, beam].mean()) < 0.003


def test_a_grazed_wall_has_no_edges_however_far_apart_its_beams_are() -> None:
    sure = replace(UST_20LX, mixed_share=1.0, reach_m=1e3)
    wall = grazing(15.0)
    along = slice(beams_at(-60.0), beams_at(-4.5))
    mixed, clean = (seen(wall, spec=spec)[:, along] for spec in (sure, replace(sure, mixed_share=0.0)))
    assert np.abs(np.diff(clean[0])).max() > 2 * returns.EDGE_M
    np.testing.assert_array_equal(mixed, clean)


def test_either_beam_at_an_edge_is_as_likely_the_mixed_one() -> None:
    scene = surfaces.join(
        [facing(5.0, 1.0, Material.PLAIN), made_of(np.array([[3.0, -0.5, 3.0, 0.0]]), Material.PLAIN)]
    )
    seen_m = seen(scene, 2000, spec=replace(UST_20LX, mixed_share=1.0))
    last_near = beams_at(0.0)
    between = (seen_m[:, last_near - 1 : last_near + 2] > 3.15) & (seen_m[:, last_near - 1 : last_near + 2] < 4.85)
    shares = np.sort(between.mean(axis=0))[-2:]
    assert between.any(axis=1).mean() > 0.8
    assert shares.min() > 0.7 * shares.max()
