"""Which lasers are used together: only where each is mounted tells how their scans fit together."""

from collections.abc import Iterator
from dataclasses import dataclass

from wayfi.frontends.events import Event, Warned
from wayfi.frontends.frames.frame_tree import frame_name
from wayfi.frontends.intake.mounts import Mounts
from wayfi.frontends.lasers.laser import MOST_LASERS
from wayfi.frontends.measurements import PAUSE_NS


@dataclass(frozen=True, slots=True)
class _Used:
    frame: str
    mounted: bool
    stamp_ns: int


class Companions:
    """Takes the sweeps of every laser whose mount is known; of the others only the one that is used already.

    Another takes its place when it has been silent for a second. `one_mount`: the configuration says where one laser
    is mounted, so that only one is used.
    """

    def __init__(self, mounts: Mounts, one_mount: bool) -> None:
        self._mounts, self._one_mount = mounts, one_mount
        self._used: _Used | None = None
        self._told: set[str] = set()

    def takes(self, stamp_ns: int, frame_id: str) -> bool:
        """Whether the next sweep, of this frame, is used."""
        frame, used = frame_name(frame_id), self._used
        mounted = self._mounts.knows(frame) and not self._one_mount
        alone = used is None or used.frame == frame or stamp_ns - used.stamp_ns > PAUSE_NS
        if alone or mounted:
            self._used = _Used(frame, mounted, stamp_ns)
        return alone or mounted

    def tell(self, stamp_ns: int, name: str) -> Iterator[Event]:
        """Say once of a laser why it is not used."""
        if self._used is None or name in self._told or len(self._told) >= MOST_LASERS:
            return
        self._told.add(name)
        why = "lidar.mount is that of one laser" if self._one_mount else "no /tf_static says where it is mounted"
        text = f"{why}, so that it is not used beside {self._used.frame!r}; /tf_static must lead to both"
        yield Warned(stamp_ns, f"{name}: {text}")
