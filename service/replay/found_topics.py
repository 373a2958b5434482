"""The topics that a recording has in place of the configured ones."""

from dataclasses import replace
from typing import Any

from wayfi.recordings.mcap.recording import Recording
from wayfi.recordings.ros.discovery import find_topics
from wayfi.service.config import Config


def with_found_topics(config: Config, recording: Recording) -> tuple[Config, list[str]]:
    """`config` with the topics that were found in `recording`, and a line for each found or to be chosen.

    A black box has its own configuration, which says what its daemon subscribed to.
    """
    if recording.is_blackbox:
        return config, []
    found = find_topics(recording.channels, config.recording.every_topic)
    topics: dict[str, Any] = {sensor.value: topic for sensor, topic in found.topics.items()}
    return replace(config, recording=replace(config.recording, **topics)), list(found.warnings)
