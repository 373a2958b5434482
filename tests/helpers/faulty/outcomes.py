"""Whole drives in this process, of messages that were changed on the way, and what comes of them."""

from collections.abc import Callable
from dataclasses import dataclass

from drives import Arrival

from wayfi.backend.pose2 import Floats
from wayfi.frontends.measurements import LaserScan, Odometry, Sensor, StaticTransforms, WifiScan
from wayfi.recordings.log import NullLog
from wayfi.recordings.ros.codec import encode
from wayfi.recordings.ros.topics import Encoding
from wayfi.recordings.trajectory import Trajectory
from wayfi.service.config import Config
from wayfi.service.drive.drive import Drive
from wayfi.service.evaluation.trajectory_scores import absolute_error

SENSORS = {
    Odometry: Sensor.ODOM,
    LaserScan: Sensor.SCAN,
    WifiScan: Sensor.WIFI,
    StaticTransforms: Sensor.TF_STATIC,
}
Change = Callable[[Arrival], Arrival]


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """What came of a drive: its final poses, its warnings, and how many messages of each topic were used."""

    ate_m: float
    final: Floats
    told: list[str]
    used: dict[str, int]


def drive(arrivals: list[Arrival], truth: Trajectory) -> Outcome:
    """Feed the arrivals, in the order of their coming in, in this process."""
    drive = Drive(Config(), None, NullLog())
    for a in sorted(arrivals, key=lambda a: a.at_ns):
        sensor, said = SENSORS[type(a.measurement)], Encoding.CDR if a.encoding == "cdr" else Encoding.JSON
        drive.show(drive.feed(sensor, said, encode(a.measurement) if a.data is None else a.data))
    result, counters = drive.finish(), drive.counters
    error = absolute_error(Trajectory(result.stamps_ns, result.final), truth).error
    assert error.not_covered == 0
    used = {t: n - sum(counters.dropped.get(t, {}).values()) for t, n in counters.messages.items()}
    return Outcome(error.ate_rmse_m, result.final, counters.warnings, used)


def of(
    kind: type | tuple[type, ...], how: Change, from_s: float = 0.0, to_s: float = 1e9
) -> Callable[[list[Arrival]], list[Arrival]]:
    """The arrivals with those of a kind changed, while they come in from `from_s` to `to_s`."""
    return lambda arrivals: [
        how(a) if isinstance(a.measurement, kind) and from_s <= a.second < to_s else a for a in arrivals
    ]
