"""The errors of a reproduction."""

from wayfi.backend.errors import WayfiError


class ReproductionError(WayfiError):
    """A recording without what the method needs."""
