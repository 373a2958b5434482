"""The diagnosis of a recording: what it holds, what a replay of its beginning says, a verdict, what to type next."""

import re
import shlex
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from wayfi.frontends.calibration import Calibration
from wayfi.frontends.measurements import Sensor
from wayfi.recordings.bags.opening import open_any_recording
from wayfi.recordings.inspection import Inspection, TopicInspection, inspect_recording
from wayfi.recordings.ros.messages import sensor_of_type
from wayfi.service.config import Config
from wayfi.service.replay.found_topics import suggested_topics, with_found_topics, with_topics
from wayfi.service.replay.trial import Trial, try_out

LEAST_POSES = 2  # one alone is no trajectory
LEAST_IN_BAND = 0.001  # of a cloud's points: some noise there makes no map
LEAST_USED = 0.1  # of a stream: less is told as not used
_SETTING = re.compile(r"--set ([\w.]+=[^\s;,]+)")
_NUMBERS = ("no", "one", "two", "three", "four", "five", "six")
_MOTION = (Sensor.ODOM, Sensor.SCAN, Sensor.POINTS)
_SENSED = (Sensor.ODOM, Sensor.SCAN, Sensor.POINTS, Sensor.WIFI)
_EXPECTED = {
    (True, True, True): "a map; places are recognised again by WiFi and laser",
    (True, True, False): "a map; places are recognised again by the laser alone",
    (True, False, True): "a path whose drift WiFi corrects, and no map of walls",
    (True, False, False): "the path of the odometry with its drift, and no map of walls",
    (False, True, True): "a map led by the laser, with WiFi; long bare corridors may come out short",
    (False, True, False): "a map led by the laser; long bare corridors may come out short",
    (False, False, True): "little: nothing says how the robot moves",
    (False, False, False): "little: nothing says how the robot moves",
}


@dataclass(frozen=True, slots=True)
class Diagnosis:
    """`verdict` is a sentence or two for a person; `command` is what to type next, empty where nothing helps."""

    inspection: Inspection
    trial: Trial
    usable: bool
    verdict: str
    command: str = ""

    def to_dict(self) -> dict[str, Any]:
        """The fields as plain values for JSON; those of the inspection stand at the top."""
        plain = {"trial": asdict(self.trial), "verdict": self.verdict, "command": self.command}
        return self.inspection.to_dict() | plain | {"usable": self.usable}


def diagnose(path: Path, config: Config, calibration: Calibration | None, options: Sequence[str] = ()) -> Diagnosis:
    """Read the recording at `path` and replay its beginning; `options` are those of the command that asks.

    Raises RecordingError.
    """
    recording = open_any_recording(path)
    sought = [] if recording.is_blackbox else with_found_topics(config, recording)[1]
    topics = suggested_topics(config, recording)
    config = with_topics(config, topics)
    inspection = inspect_recording(recording, config.recording.every_topic, config.lidar, config.odometry.base_frame)
    inspection = replace(inspection, warnings=tuple(dict.fromkeys((*inspection.warnings, *sought))))
    trial = try_out(recording, config, calibration)
    if trial.poses < LEAST_POSES:
        return Diagnosis(inspection, trial, False, f"This recording cannot be replayed: {_why_not(inspection, trial)}")
    settings = [f"recording.{sensor}={topic}" for sensor, topic in topics.items()] + _remedies(inspection, trial)
    options = [*options, *(word for setting in settings for word in ("--set", setting))]
    command = shlex.join(["wayfi", "replay", str(path), "--out", "result", *options])
    return Diagnosis(inspection, trial, True, _verdict(inspection, trial), command)


def _remedies(inspection: Inspection, trial: Trial) -> list[str]:
    """The settings that the trial's warnings name for streams of which nothing is used."""
    unused = [topic for sensor in _SENSED for topic in inspection.of(sensor) if not _is_used(topic, trial)]
    names = {name for topic in unused for name in (topic.topic, *_frames(topic))}
    warnings = [warning for warning in trial.warnings if any(name in warning for name in names)]
    return list(dict.fromkeys(setting for warning in warnings for setting in _SETTING.findall(warning)))


def _frames(topic: TopicInspection) -> list[str]:
    sweeps = topic.laser or topic.cloud
    return [repr(frame) for frame in sweeps.frames] if sweeps else []


def _why_not(inspection: Inspection, trial: Trial) -> str:
    """Why a replay gives no trajectory, in one line."""
    motion = [topic for sensor in _MOTION for topic in inspection.of(sensor)]
    if not motion:
        others = [topic for topic in inspection.topics if _is_meant_for_motion(topic)]
        reasons = [f"{topic.topic}: {next(iter(topic.reasons or ()), topic.why)}" for topic in others]
        return "; ".join(["it has neither odometry nor scans that can be read", *reasons])
    told = [warning for topic in motion for warning in trial.warnings if topic.topic in warning]
    lost = [
        f"{topic.topic}: {', '.join(f'{n} {reason}' for reason, n in trial.dropped.get(topic.topic, {}).items())}"
        for topic in motion
        if topic.topic in trial.dropped
    ]
    return "; ".join(told or lost or ["no pose comes of it"])


def _is_meant_for_motion(topic: TopicInspection) -> bool:
    return topic.sensor in _MOTION or sensor_of_type(topic.type_name) in _MOTION


def _verdict(inspection: Inspection, trial: Trial) -> str:
    found = {sensor: [_described(t) for t in inspection.of(sensor) if _is_used(t, trial)] for sensor in _SENSED}
    parts = ["odometry from /tf"] if trial.led_by_transforms else []
    parts += [text for sensor in _SENSED for text in found[sensor]]
    unused = [
        f" Of {topic.topic} nothing is used: see the warnings."
        for sensor in _SENSED
        for topic in inspection.of(sensor)
        if not _is_used(topic, trial)
    ]
    has_laser = bool(found[Sensor.SCAN] or found[Sensor.POINTS])
    has_wheels = trial.led_by_transforms or bool(found[Sensor.ODOM])
    expected = _EXPECTED[has_wheels, has_laser, bool(found[Sensor.WIFI])]
    return f"This recording can be replayed: {', '.join(parts)}. Expect {expected}.{''.join(unused)}"


def _is_used(topic: TopicInspection, trial: Trial) -> bool:
    """Whether the trial used the topic; one that begins later than the trial ends is taken to be used."""
    if topic.wifi is not None and topic.wifi.readings == 0.0:
        return False
    if topic.cloud is not None and topic.cloud.in_band is not None and topic.cloud.in_band < LEAST_IN_BAND:
        return False
    return topic.topic not in trial.messages or trial.used(topic.topic) >= LEAST_USED


def _described(topic: TopicInspection) -> str:
    rate = "" if topic.rate_hz is None else f" at {topic.rate_hz:.3g} Hz"
    if topic.laser is not None:
        lasers = "a laser" if len(topic.laser.frames) == 1 else f"{_number(len(topic.laser.frames))} lasers"
        return f"{lasers} of {topic.laser.beams} beams{rate}"
    if topic.cloud is not None:
        return f"a 3D lidar{rate}"
    if topic.wifi is not None:
        count = len(topic.wifi.scans)
        return f"{_number(count)} WiFi receiver{'s' if count != 1 else ''}"
    return f"odometry{rate}"


def _number(count: int) -> str:
    return _NUMBERS[count] if count < len(_NUMBERS) else str(count)
