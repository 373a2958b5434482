"""Complaints: faults of a sensor that last. Each is warned of once when it begins and once when it ends."""

from collections import deque
from collections.abc import Generator, Iterable, Iterator, Mapping
from dataclasses import dataclass

from wayfi.frontends.events import Warned
from wayfi.frontends.measurements import PAUSE_NS, SECOND_NS

SILENT = "silent"


@dataclass(frozen=True, slots=True)
class Fault:
    """A complaint lasts while `faulty` or more of the last `window` samples are; `ends` is the text of its end."""

    faulty: int
    window: int
    ends: str


class Complaints:
    """The complaints about sensors of one kind, each known by its name, in bounded memory for each.

    `title` formats a sensor's name into the beginning of a warning. A sensor is silent when it has sent nothing for
    more than `silent_s` of the odometry's time.
    """

    def __init__(self, title: str, faults: Mapping[str, Fault], silent_s: float) -> None:
        self._title, self._silent_s = title, silent_s
        self._faults = dict(faults)
        self._recent: dict[str, dict[str, deque[bool]]] = {}
        self._silent_ns: dict[str, int] = {}
        self._lasting: set[tuple[str, str]] = set()
        self._now_ns: int | None = None

    def heard(self, name: str) -> None:
        """Sensor `name` has sent something, whatever it is."""
        self._silent_ns[name] = 0
        if name not in self._recent:
            self._recent[name] = {fault: deque(maxlen=rule.window) for fault, rule in self._faults.items()}

    def judge(
        self, stamp_ns: int, name: str, fault: str, faulty: Iterable[bool], text: str
    ) -> Generator[Warned, None, bool]:
        """Add samples of a fault; returns whether there is a complaint now. `text` is the warning where it begins."""
        recent, rule = self._recent[name][fault], self._faults[fault]
        recent.extend(faulty)
        lasts = sum(recent) >= rule.faulty
        yield from self._change(stamp_ns, name, fault, lasts, text if lasts else rule.ends)
        return lasts

    def pass_time(self, stamp_ns: int) -> Iterator[Warned]:
        """Count the silence of every sensor up to `stamp_ns` of the odometry, whose own pauses count for a second."""
        step_ns = 0 if self._now_ns is None else min(stamp_ns - self._now_ns, PAUSE_NS)
        self._now_ns = stamp_ns
        for name in self._silent_ns:
            self._silent_ns[name] += step_ns
            silent = self._silent_ns[name] > self._silent_s * SECOND_NS
            text = f"no scan for {self._silent_s:g} s" if silent else "scans come again"
            yield from self._change(stamp_ns, name, SILENT, silent, text)

    def _change(self, stamp_ns: int, name: str, fault: str, lasts: bool, text: str) -> Iterator[Warned]:
        if lasts == ((name, fault) in self._lasting):
            return
        self._lasting ^= {(name, fault)}
        yield Warned(stamp_ns, f"{self._title.format(name)}: {text}", f"{name}.{fault}", ends=not lasts)
