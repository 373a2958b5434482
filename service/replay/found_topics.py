"""The topics that a recording has in place of the configured ones."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from wayfi.frontends.measurements import Sensor
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
    return with_topics(config, found.topics), list(found.warnings)


def suggested_topics(config: Config, recording: Recording) -> dict[Sensor, str]:
    """For each sensor that nothing is read for but several topics would fit: the one with the most messages."""
    if recording.is_blackbox:
        return {}
    counts = recording.message_counts
    choices = find_topics(recording.channels, config.recording.every_topic).choices
    return {sensor: max(topics, key=lambda topic: counts.get(topic, 0)) for sensor, topics in choices.items()}


def with_topics(config: Config, topics: Mapping[Sensor, str]) -> Config:
    """`config` with these topics for their sensors."""
    named: dict[str, Any] = {sensor.value: topic for sensor, topic in topics.items()}
    return replace(config, recording=replace(config.recording, **named))
