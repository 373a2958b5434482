"""Which topics of a recording are read for a sensor whose own topic is not there: the only one of its type."""

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from wayfi.frontends.measurements import Sensor
from wayfi.recordings.ros.messages import DEFAULT_TOPICS, TYPE_OF_SENSOR, canonical_type
from wayfi.recordings.ros.topics import Channel, Topics, is_read, route, topics_of

_SHARED = frozenset(t for t, sensors in Counter(TYPE_OF_SENSOR.values()).items() if sensors > 1)  # by several sensors


@dataclass(frozen=True, slots=True)
class FoundTopics:
    """The topics to read in place of the configured ones, by sensor, and a line for each that was found or sought.

    `choices` are the topics of a sensor of which none was chosen, since several fit, sorted.
    """

    topics: dict[Sensor, str]
    warnings: tuple[str, ...]
    choices: Mapping[Sensor, list[str]] = field(default_factory=dict)


def find_topics(channels: Iterable[Channel], configured: Topics) -> FoundTopics:
    """Seek the sensors whose topics, as `configured`, none of `channels` can be read for.

    A sensor is read from the only channel of its type. Where there are several, or the topic is not the default one and
    so was asked for, nothing is chosen, and the line names the settings to choose from. Point clouds are sought only in
    recordings without any laser scan: most depth cameras send them too.
    """
    known = tuple(channels)
    found: dict[Sensor, str] = {}
    choices: dict[Sensor, list[str]] = {}
    warnings = []
    for sensor in configured:
        absent = [topic for topic in topics_of(configured, sensor) if topic and not _is_read_on(topic, sensor, known)]
        if not absent:
            continue
        if len(topics_of(configured, sensor)) > 1:
            warnings += [f"nothing can be read on {topic} (recording.{sensor})" for topic in absent]
            continue
        (topic,) = absent
        fitting = sorted({channel.topic for channel in known if _fits(channel, sensor)} - _all_of(configured))
        if sensor is Sensor.POINTS and any(_is_of(channel, Sensor.SCAN) for channel in known):
            continue
        if len(fitting) == 1 and topic == DEFAULT_TOPICS[sensor]:
            found[sensor] = fitting[0]
            warnings.append(f"{fitting[0]} is read for {sensor} (recording.{sensor}); nothing can be read on {topic}")
        elif fitting:
            warnings.append(_choice(sensor, topic, fitting))
            if topic == DEFAULT_TOPICS[sensor]:
                choices[sensor] = fitting
        elif topic != DEFAULT_TOPICS[sensor]:
            warnings.append(f"nothing can be read on {topic} (recording.{sensor}), and no other topic fits")
    return FoundTopics(found, (*warnings, *_not_read(known, configured)), choices)


def _choice(sensor: Sensor, topic: str, fitting: list[str]) -> str:
    settings = " or ".join(f"--set recording.{sensor}={each}" for each in fitting)
    if sensor is Sensor.SCAN and len(fitting) > 1:
        together = ", ".join(f'"{each}"' for each in fitting)
        settings += f", or to use them together --set 'recording.{sensor}=[{together}]'"
    return f"nothing can be read on {topic} (recording.{sensor}); give {settings}"


def _is_of(channel: Channel, sensor: Sensor) -> bool:
    """Whether the type of a channel is that of `sensor`; topics of one type for two are told apart by name."""
    wanted = TYPE_OF_SENSOR[sensor]
    if canonical_type(channel.type_name) != wanted:
        return False
    return wanted not in _SHARED or channel.topic.rpartition("/")[2] == sensor.value


def _fits(channel: Channel, sensor: Sensor) -> bool:
    return _is_of(channel, sensor) and is_read(channel.encoding)


def _is_read_on(topic: str, sensor: Sensor, channels: tuple[Channel, ...]) -> bool:
    """Whether any of the channels can be read for `sensor` on this topic."""
    return any(channel.topic == topic and route(*channel, {sensor: topic}).sensor is sensor for channel in channels)


def _all_of(configured: Topics) -> set[str]:
    return {topic for sensor in configured for topic in topics_of(configured, sensor)}


def _not_read(channels: tuple[Channel, ...], configured: Topics) -> list[str]:
    """A line for each channel of a sensor's type, on a topic that is not configured, whose encoding is unknown."""
    others = [c for c in channels if c.topic not in _all_of(configured) and not is_read(c.encoding)]
    return [
        f"{channel.topic}: not used: {route(*channel, {sensor: channel.topic}).why}"
        for channel in others
        for sensor in configured
        if _is_of(channel, sensor)
    ]
