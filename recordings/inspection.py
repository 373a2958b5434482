"""Inspection of a recording: topics, rates, gaps, clocks, geometry, frames, and what a replay would use."""

import math
from array import array
from collections import Counter
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace

import numpy as np

from wayfi.backend.pose2 import Floats
from wayfi.frontends.lidar.lidar_config import LidarConfig
from wayfi.frontends.measurements import (
    SECOND_NS,
    InitialPose,
    LaserScan,
    Measurement,
    Odometry,
    PointCloud,
    PoseFix,
    Sensor,
    WifiScan,
)
from wayfi.recordings.inspecting.clocks import ClockInspection, Stamps, clock_of
from wayfi.recordings.inspecting.frames import FrameInspection, Frames
from wayfi.recordings.inspecting.motion import Motion, OdometryInspection
from wayfi.recordings.inspecting.radio import Radio, WifiInspection
from wayfi.recordings.inspecting.sweeps import CloudInspection, Clouds, LaserInspection, Scans
from wayfi.recordings.mcap.blocks import Record
from wayfi.recordings.mcap.recording import Recording
from wayfi.recordings.ros.codec import decode, encoding_of
from wayfi.recordings.ros.codec_error import CodecError
from wayfi.recordings.ros.discovery import find_topics
from wayfi.recordings.ros.messages import DEFAULT_TOPICS
from wayfi.recordings.ros.topics import Channel, Route, Topics, route

_LARGEST_STAMP_NS = 2**63 - 1
_WITHOUT_CLOCK = (None, Sensor.TF_STATIC, Sensor.TF, Sensor.FIX, Sensor.INITIAL_POSE)
_MOST_REASONS, _SHOWN_REASONS = 1000, 3


@dataclass(frozen=True, slots=True)
class TimeFaults:
    """How often a stamp is earlier than, or equal to, that of the previous message of the same source."""

    jumps_back: int = 0
    duplicates: int = 0


@dataclass(frozen=True, slots=True)
class TopicInspection:
    """One topic. Stamps are from message headers if the topic is used, else log times; None without any stamp.

    `undecodable` messages are counted in `count` but have no stamp; `reasons` are the codec's most frequent ones.
    `rate_hz` is one over the median interval, by what `rate_by` names: "stamp" or "log time". `beams` is the most
    frequent number of beams of a scan, or of points of a cloud. The rest is None for topics of other sensors.
    """

    topic: str
    type_name: str
    encoding: str
    used: bool
    why: str
    count: int
    undecodable: int
    first_stamp_ns: int | None
    last_stamp_ns: int | None
    rate_hz: float | None
    longest_gap_s: float | None
    time_faults: TimeFaults
    non_finite: int
    receivers: tuple[str, ...]
    bssids: int | None
    beams: int | None
    sensor: str | None = None
    reasons: Mapping[str, int] | None = None
    rate_by: str = "stamp"
    clock: ClockInspection | None = None
    odometry: OdometryInspection | None = None
    laser: LaserInspection | None = None
    cloud: CloudInspection | None = None
    wifi: WifiInspection | None = None


@dataclass(frozen=True, slots=True)
class Inspection:
    """A whole recording. It is `usable` if it has odometry, scans or point clouds that can be decoded.

    `frames` is the tree of the fixed transforms, and `frame_faults` what is wrong with or missing from it.
    """

    path: str
    duration_s: float
    message_count: int
    sha256: str
    usable: bool
    topics: tuple[TopicInspection, ...]
    warnings: tuple[str, ...]
    frames: tuple[FrameInspection, ...] = ()
    frame_faults: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, object]:
        """The fields as plain values for JSON."""
        return asdict(self)

    @property
    def stamped_s(self) -> float | None:
        """Seconds from the first stamp to the last of the longest stream that is used; None without stamps."""
        spans_ns = [
            topic.last_stamp_ns - topic.first_stamp_ns
            for topic in self.topics
            if topic.clock
            and not topic.clock.still
            and topic.last_stamp_ns is not None
            and topic.first_stamp_ns is not None
        ]
        return max(spans_ns) / SECOND_NS if spans_ns else None

    def of(self, sensor: Sensor) -> list[TopicInspection]:
        """The topics that are read for a sensor and can be decoded."""
        return [topic for topic in self.topics if topic.sensor == sensor and topic.undecodable < topic.count]


class _ChannelStatistics:
    """Counts over the messages of one channel so far."""

    def __init__(self, channel: Channel, topic_route: Route, frames: Frames) -> None:
        self.channel = channel
        self.route = topic_route
        self.count = 0
        self.undecodable = 0
        self.non_finite = 0
        self.bssids: set[str] = set()
        self._frames = frames
        self._reasons: Counter[str] = Counter()
        self._sizes: Counter[int] = Counter()
        self._stamps_ns: dict[str, array[int]] = {}
        self._log_times_ns: dict[str, array[int]] = {}
        self._motion, self._scans, self._clouds, self._radio = Motion(), Scans(), Clouds(), Radio()

    def add(self, record: Record) -> None:
        self.count += 1
        log_time_ns = min(record.log_time_ns, _LARGEST_STAMP_NS)
        if self.route.sensor is None or self.route.encoding is None:
            self._add_stamp("", log_time_ns, log_time_ns)
            return
        try:
            self._count(decode(record.data, self.route.sensor, self.route.encoding), log_time_ns)
        except CodecError as error:
            self.undecodable += 1
            if len(self._reasons) < _MOST_REASONS:
                self._reasons[str(error)] += 1

    def inspection(self, config: LidarConfig) -> TopicInspection:
        topic, type_name, encoding = self.channel
        stamps_ns = np.sort(
            np.array([stamp for stamps in self._stamps_ns.values() for stamp in stamps], dtype=np.int64)
        )
        sensor, clock = self.route.sensor, self._clock()
        rated_ns = stamps_ns if sensor is Sensor.WIFI else np.sort(self._of_main_source(self._stamps_ns))
        by_log_time = sensor is None or (clock is not None and clock.still)
        steps_s = np.diff(rated_ns) / SECOND_NS
        timed_ns = np.sort(self._of_main_source(self._log_times_ns)) if by_log_time else rated_ns
        return TopicInspection(
            topic=topic,
            type_name=type_name,
            encoding=encoding,
            used=self.route.used,
            why=self.route.why,
            count=self.count,
            undecodable=self.undecodable,
            first_stamp_ns=int(stamps_ns[0]) if len(stamps_ns) else None,
            last_stamp_ns=int(stamps_ns[-1]) if len(stamps_ns) else None,
            rate_hz=_median_rate_hz(np.diff(timed_ns) / SECOND_NS),
            longest_gap_s=float(steps_s.max()) if len(steps_s) else None,
            time_faults=self._time_faults(),
            non_finite=self.non_finite,
            receivers=tuple(sorted(self._stamps_ns)) if sensor is Sensor.WIFI else (),
            bssids=len(self.bssids) if sensor is Sensor.WIFI else None,
            beams=max(self._sizes, key=lambda size: (self._sizes[size], size)) if self._sizes else None,
            sensor=sensor,
            reasons=dict(self._reasons.most_common(_SHOWN_REASONS)),
            rate_by="log time" if by_log_time else "stamp",
            clock=clock,
            odometry=self._motion.inspection() if sensor is Sensor.ODOM else None,
            laser=self._scans.inspection(),
            cloud=self._clouds.inspection(self._frames.mounts, config),
            wifi=self._radio.inspection() if sensor is Sensor.WIFI else None,
        )

    def _count(self, measurement: Measurement, log_time_ns: int) -> None:
        self._add_stamp(_source(measurement), measurement.stamp_ns, log_time_ns)
        if isinstance(measurement, WifiScan):
            self.bssids.update(measurement.bssids)
            self._radio.add(measurement)
            return
        if isinstance(measurement, PoseFix | InitialPose):
            self.non_finite += not measurement.T_map_base.is_finite()
            return
        self._frames.add(measurement)
        if isinstance(measurement, Odometry):
            self.non_finite += not measurement.pose.is_finite()
            self._motion.add(measurement)
        elif isinstance(measurement, LaserScan):
            self._sizes[len(measurement.ranges)] += 1
            self._scans.add(measurement)
        elif isinstance(measurement, PointCloud):
            self._sizes[len(measurement.points)] += 1
            self._clouds.add(measurement)

    def _add_stamp(self, source: str, stamp_ns: int, log_time_ns: int) -> None:
        self._stamps_ns.setdefault(source, array("q")).append(stamp_ns)
        self._log_times_ns.setdefault(source, array("q")).append(log_time_ns)

    def _clock(self) -> ClockInspection | None:
        """The clock of the source that sent most; what comes now and then has none, nor what is not decoded."""
        if self.route.sensor in _WITHOUT_CLOCK or not self._stamps_ns:
            return None
        return clock_of(self._of_main_source(self._stamps_ns), self._of_main_source(self._log_times_ns))

    def _of_main_source(self, times_ns: "dict[str, array[int]]") -> Stamps:
        """The times of the source that sent most, in the order of the recording."""
        return np.array(max(times_ns.values(), key=len, default=()), np.int64)

    def _time_faults(self) -> TimeFaults:
        if self.route.sensor in _WITHOUT_CLOCK:
            return TimeFaults()
        steps = [np.diff(np.array(stamps, dtype=np.int64)) for stamps in self._stamps_ns.values()]
        return TimeFaults(
            jumps_back=sum(int(np.count_nonzero(step < 0)) for step in steps),
            duplicates=sum(int(np.count_nonzero(step == 0)) for step in steps),
        )


def inspect_recording(
    recording: Recording, topics: Topics | None = None, config: LidarConfig | None = None, base_frame: str = ""
) -> Inspection:
    """Read a whole recording; `topics` are those configured for the sensors (None: the defaults).

    `config` and `base_frame` say where lasers are mounted and which points of clouds are used. Raises RecordingError if
    nothing can be read.
    """
    configured = DEFAULT_TOPICS if topics is None else topics
    sought = find_topics(recording.channels, configured)
    topics, config = {**configured, **sought.topics}, config or LidarConfig()
    frames = Frames(config, base_frame)
    statistics: dict[Channel, _ChannelStatistics] = {}
    for record in recording:
        channel = Channel(record.topic, record.type_name, encoding_of(record.data, record.encoding))
        if channel not in statistics:
            statistics[channel] = _ChannelStatistics(channel, route(*channel, topics), frames)
        statistics[channel].add(record)
    missing = frames.missing()
    found = [statistics[channel].inspection(config) for channel in sorted(statistics)]
    return Inspection(
        path=str(recording.path),
        duration_s=recording.duration_s,
        message_count=sum(topic.count for topic in found),
        sha256=recording.sha256(),
        usable=any(_is_usable(channel) for channel in statistics.values()),
        topics=_against_odometry(found),
        warnings=(*recording.warnings, *sought.warnings),
        frames=frames.inspection(),
        frame_faults=tuple(missing),
    )


def _source(m: Measurement) -> str:
    """What tells the sources on one topic apart."""
    if isinstance(m, WifiScan):
        return m.receiver
    if isinstance(m, Odometry):
        return m.child_frame_id
    return m.frame_id if isinstance(m, LaserScan | PointCloud) else ""


def _against_odometry(topics: list[TopicInspection]) -> tuple[TopicInspection, ...]:
    """The topics, their clocks compared with that of the odometry, if there is any."""
    odometry = next((topic.clock for topic in topics if topic.sensor == Sensor.ODOM and topic.clock), None)
    if odometry is None:
        return tuple(topics)
    compared = []
    for topic in topics:
        if topic.clock is not None and topic.sensor != Sensor.ODOM:
            ahead_s = topic.clock.offset_s - odometry.offset_s
            topic = replace(topic, clock=replace(topic.clock, against_odometry_s=ahead_s))
        compared.append(topic)
    return tuple(compared)


def _is_usable(channel: _ChannelStatistics) -> bool:
    return channel.route.sensor in (Sensor.ODOM, Sensor.SCAN, Sensor.POINTS) and channel.undecodable < channel.count


def _median_rate_hz(steps_s: Floats) -> float | None:
    """One over the median of `steps_s` (n,), without steps of zero (duplicates, or receivers in parallel)."""
    moving = steps_s[steps_s > 0.0]
    rate_hz = 1.0 / float(np.median(moving)) if len(moving) else math.nan
    return rate_hz if math.isfinite(rate_hz) else None
