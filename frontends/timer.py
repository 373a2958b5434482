"""The interface by which a caller times the stages of the estimation, which reads no clock itself."""

from contextlib import AbstractContextManager, nullcontext
from typing import Protocol


class Timer(Protocol):
    """Times the stages; the caller of the pipeline provides one."""

    def __call__(self, stage: str) -> AbstractContextManager[None]:
        """A context in which the named stage runs."""
        ...


def untimed(stage: str) -> AbstractContextManager[None]:  # noqa: ARG001 - a Timer has it
    """A timer that does not time."""
    return nullcontext()
