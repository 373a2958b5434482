"""Names the streams of which nothing can be used: which topic, for what reason, and what to do about it."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field

from wayfi.frontends.events import Dropped, DropReason, Event, Warned
from wayfi.frontends.measurements import SECOND_NS, Sensor

BLOCK = 50  # messages of a topic that are judged together: 1 to 5 s of a laser or of odometry
UNUSED_SHARE = 0.9  # of a block; faults that come and go leave more of it

OF_READINGS = (DropReason.MALFORMED_BSSID, DropReason.ABSURD_RSSI)  # of which a scan has many
OLD_READING = (Sensor.WIFI, DropReason.TOO_LATE)  # the rest of its scan is used
# Other reasons are told where they are found: by the codec, of the receiver, of the laser, or of the frame.
REMEDIES = {
    DropReason.NON_FINITE: "their numbers are NaN or infinite; look at what the driver computes",
    DropReason.DUPLICATE: "their stamps do not move, the newest is {stamp_s:.3f} s; fix header.stamp in the driver",
    DropReason.STAMP_BACK: "their stamps jump back again and again; let only one driver publish on a topic, "
    "and fix its header.stamp",
    DropReason.STAMP_AHEAD: "their stamps leap ahead, the newest to {stamp_s:.3f} s; fix header.stamp in the driver",
    DropReason.NO_READINGS: "they hold no readings; look at what the receiver's driver fills in",
    DropReason.MALFORMED_BSSID: "their BSSIDs are in a form that is not known; send aa:bb:cc:dd:ee:ff",
    DropReason.ABSURD_RSSI: "their RSSI is outside -120 to 0; send dBm, neither per cent nor values without sign",
    DropReason.TOO_MANY_RECEIVERS: "there are too many receivers; name a receiver, not a scan, in header.frame_id",
    DropReason.TOO_MANY_WAIT: "they wait for odometry that does not come; synchronise the sensors' clocks",
    DropReason.NO_POSE: "they wait for odometry of their stamps, which are {off}; synchronise the sensors' clocks",
    DropReason.TOO_LATE: "their stamps are {off}, which is too old; send them sooner, or synchronise the clocks",
    DropReason.AHEAD: "their stamps are {off}; synchronise the clocks",
    DropReason.IMPLAUSIBLE_MOTION: "their poses are further off than any robot drives; send m",
    DropReason.NO_MAP: "without a map there is nowhere to be put; give one with --map",
    DropReason.OTHER_LASER: "another laser came first and is used; to use this one, give the other a topic that "
    "is not there (--set recording.scan=/none, or recording.points=/none)",
}


@dataclass(slots=True)
class _Stream:
    """What has been dropped of a topic since its message number `begun`, and in the whole drive."""

    begun: int
    block: Counter[DropReason] = field(default_factory=Counter)
    drive: Counter[DropReason] = field(default_factory=Counter)
    complaint: DropReason | None = None
    told: bool = False


class UnusedStreams:
    """Watches what is dropped of each topic; a complaint lasts while nearly all of its messages are.

    What a sensor's own watch complains of by its reason is not told again.
    """

    def __init__(self, topics: Mapping[Sensor, str]) -> None:
        self._topics = topics
        self._streams: dict[str, _Stream] = {}
        self._newest: dict[str, Dropped] = {}
        self._told: set[str] = set()

    def judge(self, messages: Mapping[str, int], events: Iterable[Event], now_ns: int) -> list[Event]:
        """The complaints that begin or end with these events.

        `messages` counts those of each topic so far, and `now_ns` is the newest odometry's stamp.
        """
        events = list(events)
        self._told |= {e.complaint.rpartition(".")[2] for e in events if isinstance(e, Warned)}
        dropped = [event for event in events if isinstance(event, Dropped)]
        for event in dropped:
            if (event.sensor, event.reason) != OLD_READING:
                self._count(event, messages)
        if not dropped and not any(stream.complaint for stream in self._streams.values()):
            return []
        return [told for topic in self._streams for told in self._judge_block(topic, messages[topic], now_ns)]

    def finish(self, messages: Mapping[str, int], now_ns: int) -> list[Event]:
        """At the end: the complaints about topics of which nearly nothing was used, too few for any before."""
        return [
            Warned(now_ns, self._text(topic, stream.drive, messages[topic], now_ns))
            for topic, stream in self._streams.items()
            if not stream.told and self._complaint(stream.drive, messages[topic])
        ]

    def _count(self, event: Dropped, messages: Mapping[str, int]) -> None:
        topic = event.topic or self._topics[event.sensor]
        stream = self._streams.setdefault(topic, _Stream(max(messages[topic] - 1, 0)))
        stream.block[event.reason] += 1
        stream.drive[event.reason] += 1
        self._newest[topic] = event

    def _judge_block(self, topic: str, messages: int, now_ns: int) -> Iterator[Warned]:
        stream = self._streams[topic]
        count = messages - stream.begun
        if count < BLOCK:
            return
        complaint = self._complaint(stream.block, count)
        if complaint and complaint != stream.complaint:
            stream.told = True
            yield Warned(now_ns, self._text(topic, stream.block, count, now_ns), f"{topic}.unused")
        elif stream.complaint and not complaint:
            yield Warned(now_ns, f"{topic}: its messages are used again", f"{topic}.unused", ends=True)
        stream.complaint = complaint
        stream.begun, stream.block = messages, Counter()

    def _complaint(self, dropped: Counter[DropReason], messages: int) -> DropReason | None:
        """The reason for which nearly all messages are dropped; None where they are not, or it is told otherwise."""
        whole = Counter({reason: count for reason, count in dropped.items() if reason not in OF_READINGS})
        if not whole or whole.total() < UNUSED_SHARE * messages:
            return None
        reason = whole.most_common(1)[0][0]
        if reason is DropReason.NO_READINGS:
            reason = max((each for each in OF_READINGS if each in dropped), key=dropped.__getitem__, default=reason)
        return reason if reason in REMEDIES and reason not in self._told else None

    def _text(self, topic: str, dropped: Counter[DropReason], messages: int, now_ns: int) -> str:
        reason = self._complaint(dropped, messages)
        assert reason
        stamp_ns = self._newest[topic].stamp_ns
        off = (
            f"{(stamp_ns - now_ns) / SECOND_NS:+.1f} s from the odometry's newest" if now_ns else "before any odometry"
        )
        why = REMEDIES[reason].format(stamp_s=stamp_ns / SECOND_NS, off=off)
        unused = min(sum(n for r, n in dropped.items() if r not in OF_READINGS), messages)
        return f"{topic}: {unused} of its {messages} messages are not used: {why}"
