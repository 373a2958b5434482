"""The interface by which a caller times the stages of the estimation, which reads no clock itself."""

from contextlib import AbstractContextManager
from typing import Protocol


class Timer(Protocol):
    """Times the stages; the caller of the pipeline provides one."""

    def __call__(self, stage: str) -> AbstractContextManager[None]:
        """A context in which the named stage runs."""
        ...
