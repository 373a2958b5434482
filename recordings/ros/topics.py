"""Which topics of a recording are read for which sensor, and why others are not."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple

from wayfi.frontends.measurements import Sensor
from wayfi.recordings.ros.messages import TYPE_OF_SENSOR, canonical_type, sensor_of_type

# The control records of a black box: what the daemon did between two messages. The names are older than the term, and
# stay so that black boxes written before can be replayed.
CONTROL_TOPIC = "/wayfi/marks"
CONTROL_TYPE = "wayfi/Mark"


class Channel(NamedTuple):
    """A channel of a recording: its topic, the type of its messages, and their encoding."""

    topic: str
    type_name: str
    encoding: str


class Encoding(StrEnum):
    """The encoding of a message, by the name that MCAP channels use."""

    CDR = "cdr"
    JSON = "json"


Topics = Mapping[Sensor, str | tuple[str, ...]]  # those that each sensor is read from


@dataclass(frozen=True, slots=True)
class Route:
    """The `sensor` and `encoding` that a topic is read with, both None if it is not used; `why` is an explanation."""

    sensor: Sensor | None
    encoding: Encoding | None
    why: str

    @property
    def used(self) -> bool:
        """Whether the topic is read for a sensor."""
        return self.sensor is not None


def _unused(why: str) -> Route:
    return Route(None, None, why)


def is_read(encoding: str) -> bool:
    """Whether messages of this encoding can be decoded."""
    return encoding in tuple(Encoding)


def _unknown_encoding(encoding: str, sensor: Sensor) -> str:
    how = "convert its messages to one of these (`wayfi import` does so from ROS 1, rosbag2 and CARMEN)"
    return f"unknown encoding {encoding or '(none)'}; {sensor} takes cdr or json, and recordings ros1 as well: {how}"


def route(topic: str, type_name: str, encoding: str, topics: Topics) -> Route:
    """The route of a channel (`topic`, `type_name`, `encoding`), given the `topics` configured for the sensors."""
    if topic == CONTROL_TOPIC:
        return _unused("feeds no sensor: a replay does what the daemon did between two messages")
    sensor = next((sensor for sensor in topics if topic in topics_of(topics, sensor)), None)
    if sensor is None:
        by_type = sensor_of_type(type_name)
        if by_type is None and "Compressed" in type_name and "Point" in type_name:
            return _unused(f"{type_name} is not read: republish it as sensor_msgs/msg/PointCloud2, not compressed")
        if by_type is None:
            return _unused(f"no sensor is configured for this topic (type {type_name or 'unknown'})")
        expected = " and ".join(topics_of(topics, by_type))
        return _unused(f"a {by_type} type, but {by_type} is read from {expected or 'no topic'}")
    if not is_read(encoding):
        return _unused(_unknown_encoding(encoding, sensor))
    if encoding == Encoding.CDR and canonical_type(type_name) != TYPE_OF_SENSOR[sensor]:
        return _unused(f"unknown type {type_name or '(none)'}; {sensor} takes {TYPE_OF_SENSOR[sensor]}")
    return Route(sensor, Encoding(encoding), f"feeds {sensor}")


def topics_of(topics: Topics, sensor: Sensor) -> tuple[str, ...]:
    """The topics that a sensor is read from."""
    names = topics.get(sensor, ())
    return (names,) if isinstance(names, str) else names
