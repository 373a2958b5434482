"""Collections leave alone what was loaded before, and see it again afterwards."""

import gc

import pytest

from wayfi.service.process.collection import NEW_OBJECTS, collect_seldom, loaded_objects_left_alone


def test_only_what_comes_later_is_visited() -> None:
    before = len(gc.get_objects())
    with loaded_objects_left_alone():
        assert len(gc.get_objects()) < before / 10
        later: list[object] = [[] for _ in range(1000)]
        assert len(gc.get_objects()) >= len(later)
    assert len(gc.get_objects()) > before / 2


def test_an_error_ends_it_as_well() -> None:
    with pytest.raises(ValueError, match="stop"), loaded_objects_left_alone():
        raise ValueError("stop")
    assert gc.get_freeze_count() == 0


def test_collections_come_seldom_from_then_on() -> None:
    before = gc.get_threshold()
    try:
        collect_seldom()
        assert gc.get_threshold() == (NEW_OBJECTS, *before[1:])
    finally:
        gc.set_threshold(*before)
