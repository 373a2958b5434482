"""Mutated messages: nothing but CodecError from decoding, nothing at all from a drive, and poses stay poses."""

import math
import random
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from drives import Simulated
from faulty.fuzzed_drive import as_cloud, as_outside_poses, as_transforms, fuzzed, sensor_of, thinned
from faulty.fuzzing import Mutator
from scanning import cut

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.events import Dropped, DropReason, Event, PosePublished
from wayfi.frontends.frames.frame_tree import MOST_FRAMES
from wayfi.frontends.intake.scan_queue import MOST_WAITING
from wayfi.frontends.intake.wifi_intake import MOST_RECEIVERS
from wayfi.frontends.intake.wifi_intake import MOST_WAITING as MOST_WIFI_WAITING
from wayfi.frontends.measurements import (
    SECOND_NS,
    LaserScan,
    Measurement,
    Odometry,
    PointCloud,
    Sensor,
    StaticTransforms,
    Transform,
    WifiScan,
)
from wayfi.frontends.odometry.accepted_odometry import FURTHEST_M
from wayfi.frontends.pipeline import Pipeline
from wayfi.recordings.log import NullLog
from wayfi.recordings.ros.codec import decode, encode
from wayfi.recordings.ros.codec_error import CodecError
from wayfi.recordings.ros.ros_measurements import MAX_FIELDS, MAX_NAME, MAX_TRANSFORMS
from wayfi.recordings.ros.topics import Encoding
from wayfi.service.config import load_config
from wayfi.service.drive.drive import Drive

START_NS = 1_700_000_000 * SECOND_NS
MOUNT = Transform("base_link", "laser", (0.2, 0.0, 0.3), (0.0, 0.0, 0.0, 1.0))


@pytest.mark.parametrize("encoding", list(Encoding))
@pytest.mark.parametrize("sensor", list(Sensor))
def test_decoding_raises_nothing_but_codec_errors(sensor: Sensor, encoding: Encoding, minute: Simulated) -> None:
    mutator, decoded = Mutator(len(sensor)), 0
    sound = [encode(m) for m in messages_of(sensor, minute)]
    for number in range(1000):
        try:
            decode(mutator.message(sensor, sound[number % len(sound)], encoding), sensor, encoding)
            decoded += 1
        except CodecError:
            pass
    assert 50 < decoded < 950  # else nothing but the first check is tried, or nothing is mutated


def messages_of(sensor: Sensor, minute: Simulated) -> list[Measurement]:
    """A few sound messages of each sensor."""
    some = [thinned(a.measurement) for a in minute.arrivals[:60]]
    some += [as_cloud(m) for m in some if isinstance(m, LaserScan)]
    some += [as_transforms(m) for m in some if isinstance(m, Odometry)]
    some += [pose for m in some if isinstance(m, Odometry) for pose in as_outside_poses(m)]
    return [m for m in some if sensor_of(m) is sensor]


@pytest.mark.filterwarnings("ignore::RuntimeWarning")  # where numbers overflow, infinity is the answer
@pytest.mark.parametrize("kind", ["scans", "clouds", "laser alone", "fragments of two lasers"])
def test_a_drive_survives_and_its_poses_stay_poses(kind: str, minute: Simulated) -> None:
    drive = Drive(load_config((), ()), None, NullLog())
    published, mutated = [], 0
    for fed in fuzzed(sensors_of(kind, minute), 4000, seed=len(kind)):
        events = drive.feed(fed.sensor, fed.encoding, fed.data)
        drive.show(events)
        mutated += fed.mutated
        published += [event for event in events if isinstance(event, PosePublished)]
    assert mutated == 4000
    assert len(published) > 100
    assert all(event.T_map_base.is_finite() and event.T_map_odom.is_finite() for event in published)
    assert all(np.isfinite(event.covariance).all() for event in published)
    stamps = [event.stamp_ns for event in published]
    assert all(before < after for before, after in pairwise(stamps))
    assert np.isfinite(drive.finish().final).all()


def sensors_of(kind: str, minute: Simulated) -> Sequence[Measurement]:
    some = [thinned(a.measurement) for a in minute.arrivals]
    if kind == "clouds":
        return [as_cloud(m) if isinstance(m, LaserScan) else m for m in some]
    if kind == "fragments of two lasers":
        return [piece for m in some for piece in (pieces(m) if isinstance(m, LaserScan) else [m])]
    return [m for m in some if kind == "scans" or not isinstance(m, Odometry)]


def pieces(scan: LaserScan) -> list[LaserScan]:
    """Every tenth scan, as two lasers send it."""
    cut_up = cut(scan, 6) if scan.stamp_ns // 100_000_000 % 10 == 0 else []
    return [replace(piece, frame_id=frame) for piece in cut_up for frame in ("laser", "rear")]


def test_the_same_seed_gives_the_same_bytes(minute: Simulated) -> None:
    twice = [[fed.data for fed in fuzzed(sensors_of("scans", minute), 300, seed=3)] for _ in range(2)]
    assert twice[0] == twice[1]


# What messages could make grow, or take long over


def feed(pipeline: Pipeline, measurements: Sequence[Measurement]) -> list[Event]:
    return [event for m in measurements for event in pipeline.process(m)]


def reasons(events: list[Event]) -> list[DropReason]:
    return [event.reason for event in events if isinstance(event, Dropped)]


def wifi(stamp_ns: int, receiver: str) -> WifiScan:
    bssids = tuple(f"02:00:00:00:00:{i:02x}" for i in range(6))
    return WifiScan(stamp_ns, receiver, bssids, np.full(6, -50.0, np.float32), np.zeros(6, np.float32))


def scan(stamp_ns: int) -> LaserScan:
    return LaserScan(stamp_ns, "laser", np.linspace(2.0, 4.0, 90, dtype=np.float32), -math.pi, math.pi / 45, 0.1, 30.0)


def pipeline() -> Pipeline:
    return Pipeline(load_config((), ()))


def test_receivers_beyond_the_most_are_not_remembered() -> None:
    new = [wifi(START_NS + i, f"receiver {i}") for i in range(MOST_RECEIVERS + 50)]
    assert reasons(feed(pipeline(), new)) == [DropReason.TOO_MANY_RECEIVERS] * 50


def test_wifi_scans_that_wait_are_so_many_at_most() -> None:
    without_odometry = [wifi(START_NS + i, "phone") for i in range(MOST_WIFI_WAITING + 50)]
    assert reasons(feed(pipeline(), without_odometry)) == [DropReason.TOO_MANY_WAIT] * 50


def test_scans_that_wait_are_so_many_at_most() -> None:
    without_odometry = [scan(START_NS + i) for i in range(MOST_WAITING + 50)]
    assert reasons(feed(pipeline(), without_odometry)) == [DropReason.TOO_MANY_WAIT] * 50


def test_frames_beyond_the_most_are_not_remembered() -> None:
    frames = [Transform("base_link", f"frame {i}", (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)) for i in range(1050)]
    dropped = reasons(feed(pipeline(), [StaticTransforms(START_NS, (t,)) for t in frames]))
    assert dropped == [DropReason.TOO_MANY_FRAMES] * (1050 - MOST_FRAMES)


@pytest.mark.parametrize(
    ("translation", "rotation", "reason"),
    [
        ((1e300, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0), DropReason.ABSURD_MOUNT),
        ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1e-200), DropReason.ABSURD_MOUNT),
        ((0.0, 0.0, 0.0), (0.0, 1e200, 0.0, 1e200), DropReason.ABSURD_MOUNT),
        ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0), DropReason.ABSURD_MOUNT),
        ((0.0, math.nan, 0.0), (0.0, 0.0, 0.0, 1.0), DropReason.NON_FINITE),
    ],
)
def test_an_absurd_mount_is_dropped(
    translation: tuple[float, float, float], rotation: tuple[float, float, float, float], reason: DropReason
) -> None:
    mount = StaticTransforms(START_NS, (Transform("base_link", "laser", translation, rotation),))
    assert reasons(feed(pipeline(), [mount])) == [reason]


@pytest.mark.parametrize("x", [1.7e308, -1e300, 2 * FURTHEST_M])
def test_a_pose_where_numbers_end_is_dropped_even_as_the_first(x: float) -> None:
    poses = [Pose2(x, -x, 0.0), Pose2(0.0, 0.0, 0.0), Pose2(-x, x, 1.0), Pose2(0.1, 0.0, 0.0)]
    events = feed(pipeline(), [Odometry(START_NS + i * SECOND_NS, pose) for i, pose in enumerate(poses)])
    assert reasons(events) == [DropReason.IMPLAUSIBLE_MOTION] * 2
    published = [event.T_map_base for event in events if isinstance(event, PosePublished)]
    assert published[1].x == pytest.approx(0.1, abs=0.02)


def test_names_are_short() -> None:
    for measurement in (
        wifi(START_NS, "x" * (MAX_NAME + 1)),
        LaserScan(START_NS, "x" * (MAX_NAME + 1), np.ones(3, np.float32), 0.0, 0.1, 0.0, 30.0),
        StaticTransforms(START_NS, (Transform("a", "x" * (MAX_NAME + 1), (0, 0, 0), (0, 0, 0, 1)),)),
    ):
        for encoding in Encoding:
            with pytest.raises(CodecError, match="letters"):
                decode(encode(measurement, encoding), sensor_of(measurement), encoding)


def test_many_transforms_are_refused_before_they_are_made() -> None:
    many = encode(StaticTransforms(START_NS, (MOUNT,) * (MAX_TRANSFORMS + 1)))
    for data in (many, many[:8]):  # of the second there is no more than the count
        with pytest.raises(CodecError, match=f"{MAX_TRANSFORMS + 1} transforms"):
            decode(data, Sensor.TF_STATIC, Encoding.CDR)


@pytest.mark.parametrize("frame_id", ["", "abc", "lidar"])
def test_many_fields_of_a_point_are_refused_before_they_are_made(frame_id: str) -> None:
    data = encode(PointCloud(START_NS, frame_id, np.zeros((1, 3), np.float32)))
    at = data.index(b"\1\0\0\0\1\0\0\0\3\0\0\0") + 8  # height 1, width 1, 3 fields
    many = data[:at] + (MAX_FIELDS + 1).to_bytes(4, "little")
    with pytest.raises(CodecError, match=f"{MAX_FIELDS + 1} fields"):
        decode(many, Sensor.POINTS, Encoding.CDR)


def test_many_values_in_json_are_refused_before_they_are_read() -> None:
    with pytest.raises(CodecError, match="commas"):
        decode(b"{" + b"," * 300_000, Sensor.POINTS, Encoding.JSON)


def test_warnings_are_counted_rather_than_repeated() -> None:
    drive = Drive(load_config((), ()), None, NullLog())
    for i in range(100):
        pose = Pose2(random.Random(i).choice((-1.0, 1.0)) * (i + 10) * 100.0, 0.0, 0.0)
        drive.show(drive.feed(Sensor.ODOM, Encoding.CDR, encode(Odometry(START_NS + i * SECOND_NS, pose))))
    leapt = "the odometry leapt further than a robot drives; the leap counts as no motion"
    assert drive.counters.warnings == [leapt, f"99 times: {leapt}"]


def test_a_clock_that_leaps_by_decades_makes_the_pose_no_looser_than_an_hour_does() -> None:
    def after(gap_s: int) -> PosePublished:
        stamps = [k if k < 3 else k + gap_s for k in range(12)]
        drive = [Odometry(START_NS + s * SECOND_NS, Pose2(0.3 * k, 0.0, 0.0)) for k, s in enumerate(stamps)]
        return [event for event in feed(pipeline(), drive) if isinstance(event, PosePublished)][-1]

    hour, decade = after(3600), after(315_000_000)
    np.testing.assert_allclose(decade.covariance, hour.covariance, rtol=1e-3)
    assert decade.T_map_base.distance(hour.T_map_base) < 1e-6
