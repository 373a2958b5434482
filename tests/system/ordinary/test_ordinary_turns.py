"""Turns that come in fragments, and several lasers: what belongs together is used together."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scanning import FRONT, GOOD_M, REAR, Change, Drive, clockwise, cut, each, run, simulated

from wayfi.frontends.events import DropReason, Event, KeyframeAdded
from wayfi.frontends.measurements import LaserScan, Odometry, StaticTransforms
from wayfi.recordings.simulation.run import EPOCH_NS


@pytest.fixture(scope="module")
def front() -> Drive:
    return simulated(FRONT, "front")


@pytest.fixture(scope="module")
def both(front: Drive) -> Drive:
    """The same drive with a second laser, each stamped alike."""
    return together(front, simulated(REAR, "rear"))


def together(front: Drive, rear: Drive) -> Drive:
    """The first drive with the second one's laser as well."""
    merged = [*front.measurements, *[m for m in rear.measurements if not isinstance(m, Odometry)]]
    return Drive(sorted(merged, key=lambda m: 0 if isinstance(m, StaticTransforms) else m.stamp_ns), front.truth)


# Turns that come in fragments


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


def on_topics(scan: LaserScan) -> list[LaserScan]:
    return [replace(scan, topic=f"/scan_{scan.frame_id}")]


def halved(scan: LaserScan) -> list[LaserScan]:
    """Lasers that see half a turn, each its own."""
    return [
        replace(scan, ranges=scan.ranges[60:-60], angle_min=scan.angle_min + 60 * scan.angle_increment, angle_max=None)
    ]


def seen_rad(events: list[Event]) -> float:
    """How much of a turn the scans of keyframes see, on average."""
    scans = [e.points for e in events if isinstance(e, KeyframeAdded) and len(e.points)]
    return float(np.mean([np.ptp(np.arctan2(p[:, 1], p[:, 0])) for p in scans]))


@pytest.mark.parametrize("change", [each(), on_topics, halved], ids=["one topic", "two topics", "halves"])
def test_two_lasers_with_equal_stamps_are_used_together(both: Drive, front: Drive, change: Change) -> None:
    done, alone = run(both.with_scans(change)), run(front.with_scans(change))
    assert done.ate_m < GOOD_M
    assert not done.dropped()
    assert not done.told
    assert seen_rad(done.events) > 1.9 * math.pi > seen_rad(alone.events)
    assert abs(done.scans() - alone.scans()) <= 8


def same_frame(scan: LaserScan) -> list[LaserScan]:
    """Both in one frame, each on its topic: the second is turned to where the first is mounted, which is not far."""
    turned = math.pi if scan.frame_id == "rear" else 0.0
    begin, topic = scan.angle_min + turned, f"/scan_{scan.frame_id}"
    return [replace(scan, topic=topic, frame_id="front", angle_min=begin, angle_max=None)]


def rarer(scan: LaserScan) -> list[LaserScan]:
    """The second sends but one in four."""
    return [] if scan.frame_id == "rear" and scan.stamp_ns // 100_000_000 % 4 else [scan]


def dying(scan: LaserScan) -> list[LaserScan]:
    """The first falls silent after 20 s."""
    return [] if scan.frame_id == "front" and scan.stamp_ns > EPOCH_NS + 20_000_000_000 else [scan]


@pytest.mark.parametrize("change", [rarer, dying])
def test_of_two_lasers_each_may_be_slow_or_fall_silent(both: Drive, change: Change) -> None:
    done = run(both.with_scans(change))
    assert done.ate_m < GOOD_M
    assert not done.dropped()


def test_two_topics_of_one_frame_are_two_lasers(both: Drive) -> None:
    done = run(both.with_scans(same_frame))
    assert not done.dropped()
    assert seen_rad(done.events) > 1.9 * math.pi


@pytest.mark.parametrize("late_s", [0.02, 0.05, 0.09])
def test_two_lasers_that_are_not_stamped_alike_are_joined_by_the_odometry(late_s: float) -> None:
    """The second is measured later, not just stamped so."""
    first = simulated(FRONT, "front")
    rear = simulated(REAR, "rear", delay_s=late_s)
    done = run(together(first, rear))
    assert done.ate_m < GOOD_M
    assert not done.dropped()
    assert seen_rad(done.events) > 1.9 * math.pi


def test_without_odometry_the_first_of_two_lasers_leads(both: Drive) -> None:
    done = run(Drive([m for m in both.measurements if not isinstance(m, Odometry)], both.truth))
    assert done.ate_m < 0.1
    assert set(done.dropped()) <= {DropReason.AHEAD}
