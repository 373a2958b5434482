"""The error of decoding and encoding messages."""

from wayfi.backend.errors import WayfiError


class CodecError(WayfiError):
    """A message that cannot be decoded, or a measurement that cannot be encoded."""
