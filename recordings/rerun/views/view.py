"""The common shape of the views."""

from collections.abc import Callable
from typing import Any, Protocol

Handlers = dict[type, Callable[[Any], None]]


class View(Protocol):
    """Draws some kinds of events into the stream."""

    def handlers(self) -> Handlers:
        """The method that draws each kind of event."""
