"""What the drivers of ordinary lasers send: it is used as it was meant, or the warning says what is wrong."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
import pytest

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.events import Dropped, DropReason, Event, KeyframeAdded, Warned
from wayfi.frontends.measurements import (
    LaserScan,
    Measurement,
    Odometry,
    PointCloud,
    StaticTransform,
    StaticTransforms,
)
from wayfi.frontends.pipeline import Pipeline
from wayfi.recordings.simulation import run as simulation
from wayfi.recordings.simulation.run import start
from wayfi.recordings.simulation.worlds.blueprints import World
from wayfi.recordings.trajectory import Trajectory
from wayfi.service.config import load_config
from wayfi.service.evaluation.trajectory_scores import absolute_error

GOOD_M = 0.03  # ATE of the drive as it was simulated: 0.005; by its wheels alone: 0.4
FRONT, REAR = Pose2(0.3, 0.05, 0.0), Pose2(-0.3, -0.05, math.pi)
Change = Callable[[LaserScan], list[LaserScan]]


@dataclass(frozen=True)
class Drive:
    """What was measured, and where the robot was."""

    measurements: list[Measurement]
    truth: Trajectory

    def with_scans(self, change: Change) -> "Drive":
        """The drive with what `change` makes of each scan."""
        out: list[Measurement] = []
        for m in self.measurements:
            out += change(m) if isinstance(m, LaserScan) else [m]
        return Drive(out, self.truth)


@dataclass(frozen=True)
class Run:
    """What came of a drive."""

    ate_m: float
    events: list[Event]

    @property
    def told(self) -> str:
        return "\n".join(e.text for e in self.events if isinstance(e, Warned) and not e.ends)

    def dropped(self) -> list[DropReason]:
        return [e.reason for e in self.events if isinstance(e, Dropped)]

    def scans(self) -> int:
        """How many keyframes hold a scan."""
        return sum(isinstance(e, KeyframeAdded) and len(e.points) > 0 for e in self.events)


def run(drive: Drive, *settings: str) -> Run:
    pipeline = Pipeline(load_config((), settings))
    events = [e for m in drive.measurements for e in pipeline.process(m)]
    result, last = pipeline.finish()
    error = absolute_error(Trajectory(result.stamps_ns, result.final), drive.truth).error
    return Run(error.ate_rmse_m, events + last)


def simulated(mount: Pose2, frame: str, world: World = World.CARPARK) -> Drive:
    """45 s, every third beam of the laser's 270 degrees."""
    made = replace(start(world, 0, 0.75), T_base_laser=mount)
    measured = [m for m in simulation.measurements(made) if isinstance(m, Odometry | LaserScan)]
    half = math.sin(mount.theta / 2), math.cos(mount.theta / 2)
    static = StaticTransform("base_link", frame, (mount.x, mount.y, 0.2), (0.0, 0.0, *half))
    first: list[Measurement] = [StaticTransforms(measured[0].stamp_ns, (static,))]
    return Drive(first + [thinned(m, frame) if isinstance(m, LaserScan) else m for m in measured], made.truth)


def thinned(scan: LaserScan, frame: str) -> LaserScan:
    ranges, step = scan.ranges[::3], 3 * scan.angle_increment
    end, each_s = scan.angle_min + (len(ranges) - 1) * step, 3 * scan.time_increment_s
    return replace(scan, frame_id=frame, ranges=ranges, angle_increment=step, angle_max=end, time_increment_s=each_s)


@pytest.fixture(scope="module")
def front() -> Drive:
    return simulated(FRONT, "front")


@pytest.fixture(scope="module")
def office() -> Drive:
    return simulated(FRONT, "front", World.OFFICE)


@pytest.fixture(scope="module")
def both(front: Drive) -> Drive:
    """The same drive with a second laser, each stamped alike."""
    rear = simulated(REAR, "rear")
    merged = sorted([*front.measurements, *[m for m in rear.measurements if not isinstance(m, Odometry)]], key=_stamp)
    return Drive(merged, front.truth)


def _stamp(m: Measurement) -> int:
    return 0 if isinstance(m, StaticTransforms) else m.stamp_ns


def each(**how: Callable[[LaserScan], object]) -> Change:
    """Every scan with some of its numbers replaced."""
    return lambda scan: [replace(scan, **{name: value(scan) for name, value in how.items()})]  # type: ignore[arg-type]


def last_bearing(scan: LaserScan) -> float:
    assert scan.angle_max is not None
    return scan.angle_max


def test_the_drive_itself_is_good_and_nothing_is_told(front: Drive) -> None:
    done = run(front)
    assert done.ate_m < GOOD_M
    assert not done.told
    assert not done.dropped()


CORRECTED = {
    "no increment": (each(angle_increment=lambda _: 0.0), "angle_increment 0 cannot be"),
    "an infinite increment": (each(angle_increment=lambda _: math.inf), "angle_increment inf cannot be"),
    "a huge increment": (each(angle_increment=lambda _: 0.5), "angle_increment 0.5 cannot be"),
    "an increment in degrees": (each(angle_increment=lambda s: math.degrees(s.angle_increment)), "is in degrees"),
    "degrees": (
        each(
            angle_min=lambda s: math.degrees(s.angle_min),
            angle_max=lambda s: math.degrees(last_bearing(s)),
            angle_increment=lambda s: math.degrees(s.angle_increment),
        ),
        "angle_min -135 is in degrees",
    ),
    "millimetres": (
        each(ranges=lambda s: s.ranges * 1000, range_min_m=lambda _: 60.0, range_max_m=lambda _: 30_000.0),
        "in millimetres",
    ),
    "millimetres within metres": (each(ranges=lambda s: s.ranges * 1000), "in millimetres"),
    "centimetres": (
        each(ranges=lambda s: s.ranges * 100, range_min_m=lambda _: 6.0, range_max_m=lambda _: 3000.0),
        "in centimetres",
    ),
    "no range_max": (each(range_max_m=lambda _: 0.0), "range_max is 0: no limit"),
    "limits swapped": (each(range_min_m=lambda s: s.range_max_m, range_max_m=lambda s: s.range_min_m), "swapped"),
    "the whole sweep's time": (
        each(time_increment_s=lambda _: 0.1, scan_time_s=lambda _: 0.1),
        "time_increment of 0.1 s makes a sweep of 36 s, with 0.1 s between scans: it is the whole sweep's",
    ),
    "milliseconds": (each(time_increment_s=lambda _: 0.2), "it is in ms, and a sweep of 0.072 s is used"),
    "a sweep of 4 s": (each(time_increment_s=lambda _: 0.011, scan_time_s=lambda _: 0.0), "a sweep of 0.075 s is used"),
}


@pytest.mark.parametrize("fault", CORRECTED)
def test_numbers_that_cannot_be_right_are_corrected_and_told(front: Drive, fault: str) -> None:
    change, told = CORRECTED[fault]
    done = run(front.with_scans(change))
    assert done.ate_m < GOOD_M
    assert told in done.told
    assert done.told.startswith("laser 'front'")
    assert len(done.dropped()) < 20


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (each(angle_increment=lambda s: 0.6 * s.angle_increment), "lie evenly up to angle_max, which is used"),
        (each(angle_increment=lambda s: 1.3 * s.angle_increment), "lie evenly up to angle_max, which is used"),
        (each(angle_max=lambda _: 1.0), "straight by angle_increment, which is used"),
    ],
    ids=["too small an increment", "too large an increment", "a stale angle_max"],
)
def test_walls_tell_whether_the_increment_or_the_last_bearing_is_right(
    office: Drive, change: Change, told: str
) -> None:
    done = run(office.with_scans(change))
    assert told in done.told
    assert done.ate_m < run(office).ate_m + GOOD_M
    assert len(done.dropped()) < 20


def test_where_walls_do_not_tell_the_increment_is_believed_and_told(front: Drive) -> None:
    """In the car park pillars stand before every wall."""
    done = run(front.with_scans(each(angle_max=lambda _: 1.0)))
    assert "end at 2.356: angle_increment is believed" in done.told
    assert done.ate_m < GOOD_M


def clockwise(scan: LaserScan) -> list[LaserScan]:
    ends = {"angle_min": last_bearing(scan), "angle_max": scan.angle_min, "angle_increment": -scan.angle_increment}
    return [replace(scan, ranges=scan.ranges[::-1], time_increment_s=0.0, **ends)]


def wrapped(scan: LaserScan) -> list[LaserScan]:
    """The bearings from 225 degrees on, and up to 135."""
    return [replace(scan, angle_min=scan.angle_min + 2 * math.pi)]


def a_beam_too_many(scan: LaserScan) -> list[LaserScan]:
    return [replace(scan, angle_max=last_bearing(scan) + scan.angle_increment)]


@pytest.mark.parametrize("change", [clockwise, wrapped, a_beam_too_many])
def test_what_sound_drivers_send_is_used_without_a_word(front: Drive, change: Change) -> None:
    done = run(front.with_scans(change))
    assert done.ate_m < GOOD_M
    assert not done.told


REFUSED = {
    "nothing to go by": (each(angle_increment=lambda _: 0.0, angle_max=lambda s: s.angle_min), "would cover nothing"),
    "more than a turn": (
        each(angle_increment=lambda _: 0.05, angle_max=lambda s: s.angle_min + 18.0),
        "361 beams would cover 2.9 turns",
    ),
    "not a number": (each(angle_min=lambda _: math.nan), "angle_min nan and angle_max"),
}


@pytest.mark.parametrize("fault", REFUSED)
def test_bearings_that_nothing_tells_are_refused_by_name(front: Drive, fault: str) -> None:
    change, told = REFUSED[fault]
    done = run(front.with_scans(change))
    assert told in done.told
    assert set(done.dropped()) == {DropReason.IMPOSSIBLE_SCAN}


UNUSED: dict[str, tuple[Change, str, str]] = {
    "beyond the range that is used": (each(), "lidar.max_range_m=0.2", "beyond lidar.max_range_m, 0.2 m (--set lidar"),
    "beyond range_max": (each(range_max_m=lambda _: 1.5), "", "beyond its range_max of 1.5 m"),
    "few beams": (
        each(ranges=lambda s: s.ranges[::30], angle_increment=lambda s: 30 * s.angle_increment),
        "",
        "few beams: 11 points are left of the 13 that it sends, and a match takes 30 (--set lidar.min_points=11)",
    ),
    "no return": (each(ranges=lambda s: np.full_like(s.ranges, np.inf)), "", "few of its beams return"),
}


@pytest.mark.parametrize("fault", UNUSED)
def test_scans_of_which_nothing_is_used_are_told_with_the_reason(front: Drive, fault: str) -> None:
    change, setting, told = UNUSED[fault]
    assert told in run(front.with_scans(change), *([setting] if setting else [])).told


@pytest.mark.parametrize(
    ("height_m", "seen"), [(-0.3, "-0.10 and -0.10"), (2.0, "2.20 and 2.20"), (9.0, "9.20 and 9.2")]
)
def test_clouds_outside_of_the_height_band_are_told_with_their_heights(
    front: Drive, height_m: float, seen: str
) -> None:
    def as_cloud(m: Measurement) -> Measurement:
        if not isinstance(m, LaserScan):
            return m
        bearings = m.angle_min + m.angle_increment * np.arange(len(m.ranges))
        level = np.full(len(bearings), height_m)
        ranges = np.nan_to_num(m.ranges, posinf=0.0)
        points = np.stack([ranges * np.cos(bearings), ranges * np.sin(bearings), level], axis=1)
        return PointCloud(m.stamp_ns, m.frame_id, points.astype(np.float32))

    clouds = Drive([as_cloud(m) for m in front.measurements if m.stamp_ns % 500_000_000 < 200_000_000], front.truth)
    told = run(clouds).told
    assert "height band, between 0.2 and 1.8 m" in told
    assert f"its points are between {seen}" in told


# Turns that come in fragments


def cut(scan: LaserScan, pieces: int, stamped: bool = True) -> Iterator[LaserScan]:
    size = math.ceil(len(scan.ranges) / pieces)
    for first in range(0, len(scan.ranges), size):
        ranges = scan.ranges[first : first + size]
        begin = scan.angle_min + first * scan.angle_increment
        late_ns = round(first * scan.time_increment_s * 1e9) if stamped else 0
        ends = {"angle_min": begin, "angle_max": begin + (len(ranges) - 1) * scan.angle_increment}
        yield replace(scan, stamp_ns=scan.stamp_ns + late_ns, ranges=ranges, **ends)


def lossy(scan: LaserScan) -> list[LaserScan]:
    """Of twelve fragments one is lost, another one each time."""
    lost = scan.stamp_ns // 100_000_000 % 12
    return [piece for number, piece in enumerate(cut(scan, 12)) if number != lost]


def counter_turned(scan: LaserScan) -> list[LaserScan]:
    return [piece for turned in clockwise(scan) for piece in cut(turned, 9)]


FRAGMENTS: dict[str, Change] = {
    "twelve": lambda scan: list(cut(scan, 12)),
    "two": lambda scan: list(cut(scan, 2)),
    "forty, all stamped alike": lambda scan: list(cut(scan, 40, stamped=False)),
    "clockwise": counter_turned,
    "lossy": lossy,
}


@pytest.mark.parametrize("name", FRAGMENTS)
def test_fragments_of_a_turn_make_one_scan(front: Drive, name: str) -> None:
    done = run(front.with_scans(FRAGMENTS[name]))
    assert done.ate_m < GOOD_M
    assert "fragments of a turn" in done.told
    assert len(done.dropped()) < 45  # of the first turns, before they were known to be fragments


def narrow(scan: LaserScan) -> list[LaserScan]:
    """A scanner of 30 degrees ahead."""
    return [list(cut(scan, 9))[4]]


def test_a_small_field_of_view_is_no_fragment(front: Drive) -> None:
    done = run(front.with_scans(narrow))
    assert "fragments" not in done.told
    assert done.scans() > 10


# Two lasers


def delayed(name: str, seconds: float) -> Change:
    return lambda s: [replace(s, stamp_ns=s.stamp_ns + round(seconds * 1e9))] if s.frame_id == name else [s]


def on_topics(scan: LaserScan) -> list[LaserScan]:
    return [replace(scan, topic=f"/scan_{scan.frame_id}")]


def halved(scan: LaserScan) -> list[LaserScan]:
    """Lasers that see half a turn, each its own."""
    return [
        replace(scan, ranges=scan.ranges[60:-60], angle_min=scan.angle_min + 60 * scan.angle_increment, angle_max=None)
    ]


@pytest.mark.parametrize("change", [each(), on_topics, halved], ids=["one topic", "two topics", "halves"])
def test_two_lasers_with_equal_stamps_are_used_together(both: Drive, front: Drive, change: Change) -> None:
    done = run(both.with_scans(change))
    assert done.ate_m < GOOD_M
    assert not done.dropped()
    assert not done.told
    around = [e.points for e in done.events if isinstance(e, KeyframeAdded) and len(e.points)]
    seen = np.mean([np.ptp(np.sort(np.arctan2(p[:, 1], p[:, 0]))) for p in around])
    assert seen > 1.9 * math.pi
    assert len(around) == pytest.approx(run(front).scans(), abs=3)
