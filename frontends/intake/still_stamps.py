"""Notices stamps that do not move although what they stamp does, and the odometry: the driver does not set them."""

from collections.abc import Callable

from wayfi.frontends.measurements import SECOND_NS

LONGEST_NS = SECOND_NS // 2  # of odometry, in which parts of one sweep may all have its stamp


class StillStamps:
    """Counts messages of one sensor: `still` from `lasting` repeats of a stamp in a row until it moves as often.

    `repeated`: the newest message has the stamp and the content of the one before.
    """

    def __init__(self, lasting: int) -> None:
        self._lasting = lasting
        self._stamp_ns: int | None = None
        self._since_ns: int | None = None  # the odometry's newest stamp when `_stamp_ns` came first
        self._content: bytes | None = None
        self._repeats = self._moves = 0
        self.still = self.repeated = False

    def add(self, stamp_ns: int, odometry_ns: int | None, content: Callable[[], bytes]) -> None:
        """Note the next message, which came after odometry of `odometry_ns`; `content` gives what it holds."""
        self.repeated = False
        if stamp_ns == self._stamp_ns:
            before, self._content = self._content, content()
            self.repeated = self._content == before
            self._repeats, self._moves = 0 if self.repeated else self._repeats + 1, 0
        else:
            self._stamp_ns, self._since_ns, self._content = stamp_ns, odometry_ns, None
            self._repeats, self._moves = 0, self._moves + 1
        self.still = self._moves < self._lasting if self.still else self._begins(odometry_ns)

    def _begins(self, odometry_ns: int | None) -> bool:
        if self._repeats < self._lasting or odometry_ns is None:
            return False
        return self._since_ns is None or odometry_ns - self._since_ns > LONGEST_NS
