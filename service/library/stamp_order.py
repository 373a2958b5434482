"""Stamps of each sensor rise, unless its clock is set, and not in steps that no sensor makes: else they are no ns."""

from dataclasses import dataclass

from .arguments import ArgumentError

FIRST = 3  # stamps of a sensor by which its unit is judged
QUICKEST_NS = 100_000  # from one message to the next: no sensor here sends 10,000 a second
UNITS = {10: "seconds", 13: "milliseconds", 16: "microseconds"}  # by the digits of a time since 1970


@dataclass(slots=True)
class _Stamps:
    first_ns: int
    last_ns: int
    count: int = 1


class StampOrder:
    """The newest stamp of each stream of messages.

    A stamp further back than `lasting_jump_ns` may be that of a clock that was set: it is for the pipeline to decide,
    as of a recording.
    """

    def __init__(self, lasting_jump_ns: int) -> None:
        self._lasting_jump_ns = lasting_jump_ns
        self._streams: dict[str, _Stamps] = {}

    def add(self, stream: str, stamp_ns: int) -> None:
        """Add the next stamp of a stream. Raises ArgumentError, and forgets the stamp, where it cannot be right."""
        known = self._streams.get(stream)
        if known is None:
            self._streams[stream] = _Stamps(stamp_ns, stamp_ns)
            return
        if known.last_ns - self._lasting_jump_ns <= stamp_ns <= known.last_ns:
            raise ArgumentError(
                f"t_ns: must be later than the {stream} before, at {known.last_ns}; it is {stamp_ns}{_hint(stamp_ns)}"
            )
        if known.count == FIRST - 1 and 0 <= stamp_ns - known.first_ns <= known.count * QUICKEST_NS:
            raise ArgumentError(
                f"t_ns: must be in nanoseconds; the first {FIRST} of {stream} would be within "
                f"{stamp_ns - known.first_ns} ns, to {stamp_ns}{_hint(stamp_ns)}"
            )
        known.last_ns = stamp_ns
        known.count += 1


def _hint(stamp_ns: int) -> str:
    unit = UNITS.get(len(str(stamp_ns)))
    return f" (is it in {unit}?)" if unit else ""
