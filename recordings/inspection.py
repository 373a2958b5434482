"""Inspection of a recording: topics, rates, gaps, time faults, and what a replay would use."""

import math
from array import array
from collections import Counter
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from wayfi.frontends.measurements import SECOND_NS, LaserScan, Measurement, Odometry, PointCloud, Sensor, WifiScan
from wayfi.recordings.bags.opening import open_any_recording
from wayfi.recordings.mcap.blocks import Record
from wayfi.recordings.ros.codec import decode
from wayfi.recordings.ros.codec_error import CodecError
from wayfi.recordings.ros.discovery import find_topics
from wayfi.recordings.ros.messages import DEFAULT_TOPICS
from wayfi.recordings.ros.topics import Channel, Route, Topics, route

_LARGEST_STAMP_NS = 2**63 - 1


@dataclass(frozen=True, slots=True)
class TimeFaults:
    """How often a stamp is earlier than, or equal to, that of the previous message of the same source."""

    jumps_back: int = 0
    duplicates: int = 0


@dataclass(frozen=True, slots=True)
class TopicInspection:
    """One topic. Stamps are from message headers if the topic is used, else log times; None without any stamp.

    `undecodable` messages are counted in `count` but have no stamp. `rate_hz` is one over the median interval; `beams`
    is the most frequent number of beams of a scan, or of points of a cloud.
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


@dataclass(frozen=True, slots=True)
class Inspection:
    """A whole recording. It is `usable` if it has odometry, scans or point clouds that can be decoded."""

    path: str
    duration_s: float
    message_count: int
    sha256: str
    usable: bool
    topics: tuple[TopicInspection, ...]
    warnings: tuple[str, ...]

    def to_dict(self) -> dict[str, object]:
        """The fields as plain values for JSON."""
        return asdict(self)


class _ChannelStatistics:
    """Counts over the messages of one channel so far."""

    def __init__(self, channel: Channel, topic_route: Route) -> None:
        self.channel = channel
        self.route = topic_route
        self.count = 0
        self.undecodable = 0
        self.non_finite = 0
        self.stamps_ns: dict[str, array[int]] = {}
        self.bssids: set[str] = set()
        self.sizes: Counter[int] = Counter()

    def add(self, record: Record) -> None:
        self.count += 1
        if self.route.sensor is None or self.route.encoding is None:
            self._add_stamp("", min(record.log_time_ns, _LARGEST_STAMP_NS))
            return
        try:
            self._count(decode(record.data, self.route.sensor, self.route.encoding))
        except CodecError:
            self.undecodable += 1

    def _count(self, measurement: Measurement) -> None:
        self._add_stamp(measurement.receiver if isinstance(measurement, WifiScan) else "", measurement.stamp_ns)
        if isinstance(measurement, Odometry):
            self.non_finite += not measurement.pose.is_finite()
        elif isinstance(measurement, WifiScan):
            self.bssids.update(measurement.bssids)
        elif isinstance(measurement, LaserScan):
            self.sizes[len(measurement.ranges)] += 1
        elif isinstance(measurement, PointCloud):
            self.sizes[len(measurement.points)] += 1

    def inspection(self) -> TopicInspection:
        topic, type_name, encoding = self.channel
        stamps_ns = np.sort(np.array([stamp for stamps in self.stamps_ns.values() for stamp in stamps], dtype=np.int64))
        steps_s = np.diff(stamps_ns) / SECOND_NS
        is_wifi = self.route.sensor is Sensor.WIFI
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
            rate_hz=_median_rate_hz(steps_s),
            longest_gap_s=float(steps_s.max()) if len(steps_s) else None,
            time_faults=self._time_faults(),
            non_finite=self.non_finite,
            receivers=tuple(sorted(self.stamps_ns)) if is_wifi else (),
            bssids=len(self.bssids) if is_wifi else None,
            beams=max(self.sizes, key=lambda size: (self.sizes[size], size)) if self.sizes else None,
        )

    def _add_stamp(self, source: str, stamp_ns: int) -> None:
        self.stamps_ns.setdefault(source, array("q")).append(stamp_ns)

    def _time_faults(self) -> TimeFaults:
        if self.route.sensor in (None, Sensor.TF_STATIC, Sensor.TF):
            return TimeFaults()
        steps = [np.diff(np.array(stamps, dtype=np.int64)) for stamps in self.stamps_ns.values()]
        return TimeFaults(
            jumps_back=sum(int(np.count_nonzero(step < 0)) for step in steps),
            duplicates=sum(int(np.count_nonzero(step == 0)) for step in steps),
        )


def inspect_recording(path: Path, topics: Topics | None = None) -> Inspection:
    """Read the whole recording at `path`; `topics` are those configured for the sensors (None: the defaults).

    Raises RecordingError if it cannot be opened or has no messages.
    """
    recording = open_any_recording(path)
    configured = DEFAULT_TOPICS if topics is None else topics
    sought = find_topics(recording.channels, configured)
    topics = {**configured, **sought.topics}
    statistics: dict[Channel, _ChannelStatistics] = {}
    for record in recording:
        channel = record.channel
        if channel not in statistics:
            statistics[channel] = _ChannelStatistics(channel, route(*channel, topics))
        statistics[channel].add(record)
    found = tuple(statistics[channel].inspection() for channel in sorted(statistics))
    return Inspection(
        path=str(path),
        duration_s=recording.duration_s,
        message_count=sum(topic.count for topic in found),
        sha256=recording.sha256(),
        usable=any(_is_usable(channel) for channel in statistics.values()),
        topics=found,
        warnings=(*recording.warnings, *sought.warnings),
    )


def _is_usable(channel: _ChannelStatistics) -> bool:
    return channel.route.sensor in (Sensor.ODOM, Sensor.SCAN, Sensor.POINTS) and channel.undecodable < channel.count


def _median_rate_hz(steps_s: np.ndarray[tuple[int], np.dtype[np.float64]]) -> float | None:
    """One over the median of `steps_s` (n,), without steps of zero (duplicates, or receivers in parallel)."""
    moving = steps_s[steps_s > 0.0]
    rate_hz = 1.0 / float(np.median(moving)) if len(moving) else math.nan
    return rate_hz if math.isfinite(rate_hz) else None
