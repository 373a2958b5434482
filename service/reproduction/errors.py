"""What goes wrong with a reproduction."""

from wayfi.backend.errors import WayfiError


class ReproductionError(WayfiError):
    """A recording without what the method needs, or a folder that cannot be made."""
