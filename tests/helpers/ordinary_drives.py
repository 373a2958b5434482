"""A simulated drive as other robots would send it, through one pipeline: how far off it is, and what is told."""

from collections.abc import Iterable
from dataclasses import dataclass, replace

from drives import _SENSOR_OF, Arrival

from wayfi.recordings.log import NullLog
from wayfi.recordings.ros.codec import encode
from wayfi.recordings.ros.topics import Encoding
from wayfi.recordings.trajectory import Trajectory
from wayfi.service.config import load_config
from wayfi.service.drive.drive import Drive
from wayfi.service.evaluation.trajectory_scores import absolute_error


@dataclass(frozen=True, slots=True, eq=False)
class Fed:
    """What came of a drive: its trajectory, the warnings and reasons of states, and the drops by topic and reason."""

    trajectory: Trajectory
    told: list[str]
    dropped: dict[str, dict[str, int]]

    def ate_m(self, truth: Trajectory) -> float:
        """The ATE, m."""
        return absolute_error(self.trajectory, truth).error.ate_rmse_m


def fed(arrivals: Iterable[Arrival], *settings: str) -> Fed:
    """Feed the arrivals in the order of their coming in, each decoded from its message."""
    drive = Drive(load_config((), settings), None, NullLog())
    for a in sorted(arrivals, key=lambda a: a.at_ns):
        data = encode(a.measurement) if a.data is None else a.data
        drive.show(drive.feed(_SENSOR_OF[type(a.measurement)], Encoding.CDR, data))
    result = drive.finish()
    counters = drive.counters
    told = counters.warnings + [str(change["reason"]) for change in counters.status_changes]
    dropped = {topic: dict(reasons) for topic, reasons in counters.dropped.items()}
    return Fed(Trajectory(result.stamps_ns, result.final), told, dropped)


def renamed(arrival: Arrival, **fields: object) -> Arrival:
    """The same arrival with other fields of its measurement."""
    return replace(arrival, measurement=replace(arrival.measurement, **fields))  # type: ignore[arg-type]
