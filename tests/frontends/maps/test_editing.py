import math

import numpy as np
import pytest
from building_maps.rounds import AROUND, CONFIG, furthest_m, round_map

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.maps.editing import EditError, edit, listed_closures
from wayfi.frontends.maps.optimising import optimise

FALSE = (10, 40, Pose2(0.0, 6.0, math.pi))  # that the round is 6 m wide, and not 9.5


def test_a_false_closure_that_is_vetoed_bends_the_map_no_more() -> None:
    bent = optimise(round_map(false=FALSE), CONFIG)
    assert furthest_m(bent.poses, round_map().poses) > 1.0
    false = len(bent.closures) - 1
    mended = edit(bent, CONFIG, veto=[false])
    assert furthest_m(mended.poses, round_map().poses) < 0.01
    assert mended.vetoed == {false}


def test_restoring_undoes_a_veto() -> None:
    building = optimise(round_map(false=FALSE), CONFIG)
    again = edit(edit(building, CONFIG, veto=[3, 4]), CONFIG, restore=[4, 3])
    assert again.vetoed == frozenset()
    assert furthest_m(again.poses, building.poses) < 1e-3


def test_a_veto_sticks_when_others_are_edited() -> None:
    building = edit(round_map(), CONFIG, veto=[2])
    assert edit(building, CONFIG, veto=[3]).vetoed == {2, 3}


@pytest.mark.parametrize(
    ("veto", "restore", "told"),
    [
        ([99], [], "there is no closure 99 in this map: they are 0 to 6"),
        ([-1], [], "there is no closure -1"),
        ([0], [], "closure 0 is not part of the map .refused: inlier ratio 0.30 under 0.6."),
        ([], [2], "closure 2 is not vetoed"),
        ([1], [1, 1, 2], "closure 2 is not vetoed"),
    ],
)
def test_what_cannot_be_edited_is_told(veto: list[int], restore: list[int], told: str) -> None:
    with pytest.raises(EditError, match=told):
        edit(round_map(), CONFIG, veto, restore)


def test_a_second_veto_is_told() -> None:
    with pytest.raises(EditError, match="closure 3 is vetoed already"):
        edit(edit(round_map(), CONFIG, veto=[3]), CONFIG, veto=[3])


def test_the_list_tells_what_the_map_makes_of_each_closure() -> None:
    bent = edit(optimise(round_map(false=FALSE), CONFIG), CONFIG, veto=[1])
    listed = listed_closures(bent)
    assert [c.verdict for c in listed] == ["refused", "vetoed", *["accepted"] * 6]
    assert listed[-1].residual_m > 0.05
    assert np.allclose(listed[2].place, bent.poses[AROUND + 10, :2])
    assert listed[2].residual_m < listed[-1].residual_m
