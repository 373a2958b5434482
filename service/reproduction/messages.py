"""The sensor messages of a recording, for the batch method and the streaming service."""

from collections.abc import Callable, Iterator
from pathlib import Path

from wayfi.frontends.measurements import Sensor
from wayfi.recordings.bags.opening import open_any_recording
from wayfi.recordings.ros.discovery import find_topics
from wayfi.recordings.ros.messages import DEFAULT_TOPICS
from wayfi.recordings.ros.topics import Encoding, route

Progress = Callable[[float], None]


def sensor_messages(recording_path: Path, progress: Progress) -> Iterator[tuple[Sensor, Encoding, bytes]]:
    """The sensor, encoding and data of each message, in the order of the recording. Raises RecordingError."""
    recording = open_any_recording(recording_path)
    topics = {**DEFAULT_TOPICS, **find_topics(recording.channels, DEFAULT_TOPICS).topics}
    total = max(recording.message_count, 1)
    for number, record in enumerate(recording):
        if number % 100 == 0:
            progress(number / total)
        found = route(*record.channel, topics)
        if found.sensor is not None and found.encoding is not None:
            yield found.sensor, found.encoding, record.data
    progress(1.0)
