"""A clock that passes as it is told, however busy the machine is."""


class Clock:
    """In the place of the module `time`: the monotonic clock, set by hand or slept on."""

    def __init__(self) -> None:
        self.now_s = 1000.0

    def monotonic(self) -> float:
        return self.now_s

    def sleep(self, seconds: float) -> None:
        self.now_s += seconds
