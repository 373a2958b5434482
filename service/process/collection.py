"""Keeps Python's garbage collector from looking at what a process loaded before its work began, and at most else."""

import gc
from collections.abc import Iterator
from contextlib import contextmanager

NEW_OBJECTS = 20_000  # between two collections: Python's own 700 cost 3 % of a replay, which hardly makes any cycles


def collect_seldom() -> None:
    """Let collections come after every `NEW_OBJECTS`, for as long as the process lasts."""
    gc.set_threshold(NEW_OBJECTS, *gc.get_threshold()[1:])


@contextmanager
def loaded_objects_left_alone() -> Iterator[None]:
    """While it lasts, collections do not visit the objects that exist now: hundreds of thousands, 0.1 s each time."""
    gc.collect()
    gc.freeze()
    try:
        yield
    finally:
        gc.unfreeze()
