from dataclasses import replace

import numpy as np
import pytest
from building_maps.rounds import CONFIG, furthest_m, round_map

from wayfi.backend.graph.factors import AxisFactor, BetweenFactor, NearFactor, WheelFactor
from wayfi.backend.graph.wheel_calibration import WheelMotion
from wayfi.backend.pose2 import Pose2, compose_all
from wayfi.frontends.events import ClosureKind, Verdict
from wayfi.frontends.maps.building_map import BuildingMap
from wayfi.frontends.maps.editing import edit
from wayfi.frontends.maps.joining import Tie, join, joined_receivers, joined_weights
from wayfi.frontends.wifi.receivers import ReceiverOffset

T_A_B = Pose2(3.0, -1.0, 0.7)
TIED = np.diag([0.02**2, 0.02**2, 0.01**2])


def in_own_frame() -> BuildingMap:
    """The same round, in a frame of its own."""
    building = round_map()
    return replace(building, poses=compose_all(T_A_B.inverse().array(), building.poses))


def tie(a: int, b: int) -> Tie:
    truth = round_map().poses
    T = Pose2.of(truth[a]).between(Pose2.of(truth[b]))
    return Tie(BetweenFactor(a, b, T, TIED), T, TIED, "agrees", inlier_ratio=0.9)


TIES = [tie(5, 7), tie(40, 38), tie(100, 30)]


def test_the_union_is_both_maps_in_the_frame_of_the_first() -> None:
    a, b = round_map(), in_own_frame()
    joined = join(a, b, T_A_B, TIES, CONFIG)
    assert furthest_m(joined.poses, np.concatenate([a.poses, a.poses])) < 1e-3
    assert len(joined.factors) == len(a.factors) + len(b.factors) + 1 + len(TIES)
    assert {k.session for k in joined.keyframes} == {0, 1}
    assert joined.pieces == (len(a.keyframes),)
    assert joined.calibrations.shape == (len(joined.keyframes), 4)


def test_it_is_optimised_from_a_rough_guess() -> None:
    a, b = round_map(), in_own_frame()
    joined = join(a, b, T_A_B @ Pose2(0.5, -0.4, 0.1), TIES, CONFIG)
    assert furthest_m(joined.poses, np.concatenate([a.poses, a.poses])) < 2e-3


def test_closures_keep_their_factors_and_their_vetoes() -> None:
    a, b = round_map(), edit(in_own_frame(), CONFIG, veto=[2])
    joined = join(a, b, T_A_B, TIES, CONFIG)
    n, first = len(a.closures), len(a.keyframes)
    assert joined.vetoed == {n + 2}
    assert [c.judged.closure for c in joined.closures] == list(range(2 * n + len(TIES)))
    for number, closure in enumerate(joined.closures):
        for factor in (joined.factors[f] for f in closure.factors):
            assert (factor.a, factor.b) == (closure.judged.keyframe_a, closure.judged.keyframe_b)
            assert (factor.a >= first) == (n <= number < 2 * n)
    last = joined.closures[-1].judged
    assert (last.keyframe_a, last.keyframe_b, last.kind, last.verdict) == (
        100, first + 30, ClosureKind.LIDAR, Verdict.ACCEPTED,
    )  # fmt: skip


def test_every_tie_can_be_vetoed_and_the_maps_stay_where_they_are() -> None:
    joined = join(round_map(), in_own_frame(), T_A_B, TIES, CONFIG)
    ties = range(len(joined.closures) - len(TIES), len(joined.closures))
    assert furthest_m(edit(joined, CONFIG, veto=ties).poses, joined.poses) < 0.01


def test_joined_maps_can_be_joined_again() -> None:
    a = round_map()
    twice = join(join(a, in_own_frame(), T_A_B, TIES, CONFIG), in_own_frame(), T_A_B, TIES, CONFIG)
    assert {k.session for k in twice.keyframes} == {0, 1, 2}
    assert furthest_m(twice.poses, np.concatenate([a.poses] * 3)) < 1e-3


def test_the_wheels_of_another_drive_are_put_into_metres_and_its_axes_are_its_own() -> None:
    a, b = round_map(), in_own_frame()
    calibration = np.array([0.1, 0.0, 0.0, 0.0])
    wheels = WheelFactor(0, 1, WheelMotion(Pose2(1.0, 0.0, 0.0), 1.0, 1.0), TIED)
    axis = AxisFactor(3, 1, 0.0, 0.1)
    a = replace(a, factors=dict(a.factors) | {500: axis})
    b = replace(
        b, factors=dict(b.factors) | {900: wheels, 901: axis}, calibrations=np.tile(calibration, (len(b.poses), 1))
    )
    factors = list(join(a, b, T_A_B, TIES, CONFIG).factors.values())
    n = len(a.keyframes)
    steps = [f for f in factors if isinstance(f, BetweenFactor) and (f.a, f.b) == (n, n + 1)]
    assert any(f.T_a_b.x == pytest.approx(1.1) for f in steps)
    assert [(f.b, f.wing) for f in factors if isinstance(f, AxisFactor)] == [(3, 1), (n + 3, 2)]


def test_a_tie_by_wifi_claims_a_place_and_no_heading() -> None:
    near = Tie(NearFactor(5, 7, np.zeros(2), np.zeros(2), 1.0), Pose2(), np.eye(3), "sounds alike", similarity=0.6)
    judged = join(round_map(), in_own_frame(), T_A_B, [*TIES, near], CONFIG).closures[-1].judged
    assert (judged.kind, judged.heading_claimed, judged.similarity) == (ClosureKind.WIFI, False, 0.6)


def test_offsets_of_receivers_are_from_one_reference() -> None:
    a = {"one": ReceiverOffset(0.0, 0.0), "two": ReceiverOffset(3.0, 0.1)}
    b = {"two": ReceiverOffset(0.0, 0.0), "three": ReceiverOffset(-1.0, 0.2)}
    joined = joined_receivers(a, b)
    assert joined["two"] == a["two"]
    assert joined["three"].offset_db == pytest.approx(2.0)


def test_weights_are_the_mean_of_who_heard_it() -> None:
    assert joined_weights({"x": 0.4, "y": 0.2}, {"x": 0.6, "z": 0.1}) == pytest.approx({"x": 0.5, "y": 0.2, "z": 0.1})
