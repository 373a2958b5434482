import math

import numpy as np
import pytest
from building_maps.rounds import CONFIG, round_map
from numpy.typing import NDArray

from wayfi.backend.pose2 import Floats, Pose2, compose_all
from wayfi.frontends.maps.aligning import AlignError, align, moved
from wayfi.frontends.maps.optimising import optimise
from wayfi.frontends.measurements import SECOND_NS

T_PLAN_MAP = Pose2(40.0, -7.0, 2.0)
MAP = round_map()


def fixes(*keyframes: int) -> tuple[NDArray[np.int64], Floats]:
    """Fixes at the moments of keyframes, their headings left out."""
    poses = compose_all(T_PLAN_MAP.array(), MAP.poses[list(keyframes)])
    poses[:, 2] = 0.0
    return np.array(keyframes, np.int64) * SECOND_NS, poses


def off(T: Pose2) -> float:
    return math.hypot(T_PLAN_MAP.distance(T), T.theta - T_PLAN_MAP.theta)


@pytest.mark.parametrize("at", [(0, 30), (3, 20, 47), tuple(range(0, 120, 7))])
def test_the_map_lies_where_the_fixes_say(at: tuple[int, ...]) -> None:
    found = align(MAP, *fixes(*at))
    assert off(found.T_plan_map) < 1e-6
    assert found.residuals_m.max() < 1e-6
    assert found.used.all()


def test_moments_between_keyframes_count_and_others_do_not() -> None:
    stamps, poses = fixes(10, 40, 70)
    middle = 0.5 * (poses[0] + compose_all(T_PLAN_MAP.array(), MAP.poses[11])[0])
    poses[0, :2] = middle[:2]
    stamps[0] += SECOND_NS // 2
    stamps[2] = 10_000 * SECOND_NS
    found = align(MAP, stamps, poses)
    assert off(found.T_plan_map) < 1e-6
    assert np.isnan(found.residuals_m).tolist() == [False, False, True]
    assert found.used.tolist() == [True, True, False]


def test_wrong_fixes_are_left_out_and_told() -> None:
    stamps, poses = fixes(0, 15, 30, 45, 60)
    poses[3, 0] += 8.0
    found = align(MAP, stamps, poses)
    assert off(found.T_plan_map) < 1e-6
    assert found.used.tolist() == [True, True, True, False, True]
    assert found.residuals_m[3] == pytest.approx(8.0)


@pytest.mark.parametrize(
    ("at", "told"),
    [
        ((5,), "1 of 1 fixes are of a moment that the map knows; two are needed"),
        ((5, 5), "the fixes lie within 0.0 m"),
        ((5, 6), r"the fixes lie within 0\.5 m"),
        ((500, 600), "0 of 2 fixes"),
    ],
)
def test_too_few_are_refused(at: tuple[int, ...], told: str) -> None:
    poses = MAP.poses[np.array(at) % 120]
    with pytest.raises(AlignError, match=told):
        align(MAP, np.array(at, np.int64) * SECOND_NS, poses)


def test_fixes_that_contradict_each_other_are_refused() -> None:
    stamps, poses = fixes(0, 15, 30, 45)
    poses[:, :2] += [[0.0, 0.0], [5.0, 1.0], [-4.0, 6.0], [1.0, -9.0]]
    with pytest.raises(AlignError, match=r"the fixes contradict each other: 0 of 4"):
        align(MAP, stamps, poses)


def test_a_plan_in_other_units_is_told() -> None:
    stamps, poses = fixes(0, 15, 30, 45)
    poses[:, :2] *= 1000.0
    with pytest.raises(AlignError, match="they would if a metre of the plan were 1000"):
        align(MAP, stamps, poses)


def test_what_was_moved_stays_there_when_it_is_optimised() -> None:
    plan = moved(MAP, T_PLAN_MAP, CONFIG.grid)
    assert np.allclose(plan.poses, compose_all(T_PLAN_MAP.array(), MAP.poses))
    assert np.abs(optimise(plan, CONFIG).poses - plan.poses).max() < 2e-3
    x, y = plan.grid.origin_xy_m
    assert x > 25.0
    assert y < 0.0
