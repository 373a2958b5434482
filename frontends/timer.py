"""How the estimation lets its stages be timed without reading a clock itself."""

from contextlib import AbstractContextManager
from typing import Protocol


class Timer(Protocol):
    """Times a stage; whoever runs the pipeline hands one in."""

    def __call__(self, stage: str) -> AbstractContextManager[None]:
        """A context in which the named stage runs."""
        ...
