"""The base class of every error that wayfi raises on purpose."""


class WayfiError(Exception):
    """Says what is wrong, where, and what to do, in one line."""
