"""Keyframes taken out of a graph: what is left says what the whole graph said."""

from dataclasses import replace

import numpy as np
import pytest
from building_maps.rounds import CONFIG, round_map

from wayfi.backend.graph.factors import BetweenFactor, Factor, NearFactor
from wayfi.backend.graph.pose_graph import PoseGraph
from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.maps.building_map import BuildingMap
from wayfi.frontends.maps.marginalising import ENOUGH, Marginalisation


def solved(factors: dict[int, Factor], poses: Floats, keyframes: list[int]) -> PoseGraph:
    """The graph of these keyframes, numbered anew."""
    number = {k: n for n, k in enumerate(keyframes)}
    graph = PoseGraph(CONFIG.backend, CONFIG.wheels, Pose2.of(poses[keyframes[0]]))
    for k in keyframes:
        graph.add_keyframe(Pose2.of(poses[k]))
    for factor in factors.values():
        graph.add(replace(factor, a=number[factor.a], b=number[factor.b]))
    graph.restart(graph.calibration_values(), poses[keyframes])
    graph.settle()
    return graph


def without(building: BuildingMap, removed: list[int]) -> tuple[PoseGraph, PoseGraph, list[int]]:
    """The whole graph, the one without some keyframes, and those that are left."""
    left = [k for k in range(len(building.poses)) if k not in removed]
    graph = Marginalisation(building.factors, building.poses, ())
    graph.remove_all(removed)
    everything = list(range(len(building.poses)))
    return solved(dict(building.factors), building.poses, everything), solved(graph.factors, building.poses, left), left


def test_a_chain_without_closures_keeps_its_covariance_exactly() -> None:
    building = round_map(1)
    whole, reduced, left = without(building, list(range(5, 55)))
    expected = whole.relative_covariance(2, 58)
    assert reduced.relative_covariance(left.index(2), left.index(58)) == pytest.approx(expected, rel=1e-3, abs=1e-9)
    assert reduced.poses() == pytest.approx(building.poses[left], abs=1e-6)


def test_with_closures_it_claims_no_more_than_was_known_and_not_much_less() -> None:
    building = round_map(3)
    whole, reduced, left = without(building, list(range(60, 180)))
    for a, b in ((0, 30), (3, 50), (20, 25)):
        known = np.sqrt(np.diag(whole.relative_covariance(a, b)))
        kept = np.sqrt(np.diag(reduced.relative_covariance(left.index(a), left.index(b))))
        assert (kept > 0.9 * known).all()
        assert (kept < 1.5 * known).all()


def test_nothing_moves() -> None:
    building = round_map(3)
    whole, reduced, left = without(building, list(range(1, 180, 2)))
    assert reduced.poses() == pytest.approx(whole.poses()[left], abs=1e-6)


def test_few_factors_are_left_however_often_a_place_was_driven() -> None:
    building = round_map(12)
    graph = Marginalisation(building.factors, building.poses, ())
    graph.remove_all(range(60, 720))
    assert len(graph.factors) <= 60 * ENOUGH
    assert max(max(f.a, f.b) for f in graph.factors.values()) < 60


def test_factors_that_are_to_be_kept_stay_as_they_are() -> None:
    building = round_map(3)
    closures = {n for closure in building.closures for n in closure.factors}
    graph = Marginalisation(building.factors, building.poses, closures)
    graph.remove_all(k for k in range(180) if k % 10)
    assert all(graph.factors[n] is building.factors[n] for n in closures)


def test_places_that_are_one_relate_their_neighbours_once_their_keyframes_are_gone() -> None:
    building = round_map(1)
    near = NearFactor(10, 40, np.zeros(2), np.array([0.2, 0.1]), 0.5)
    graph = Marginalisation({**building.factors, 500: near}, building.poses, ())
    graph.remove_all([10, 40])
    assert 500 not in graph.factors
    assert any(isinstance(f, BetweenFactor) and f.b - f.a > 10 for f in graph.factors.values())
