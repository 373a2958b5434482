"""Keeps Python's garbage collector from looking at what a process loaded before its work began, and at most else."""

import gc
from collections.abc import Iterator
from contextlib import contextmanager

NEW_OBJECTS = 20_000  # between two collections: Python's own 700 cost 2 % of a replay, which hardly makes any cycles


@contextmanager
def loaded_objects_left_alone() -> Iterator[None]:
    """While it lasts, collections do not visit the objects that exist now: hundreds of thousands, 0.1 s each time.

    They come after every `NEW_OBJECTS` that are left of the new ones.
    """
    gc.collect()
    gc.freeze()
    before = gc.get_threshold()
    gc.set_threshold(NEW_OBJECTS, *before[1:])
    try:
        yield
    finally:
        gc.set_threshold(*before)
        gc.unfreeze()
