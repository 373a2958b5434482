"""The drives that maps are made of and that are localised: made once, and kept."""

import os
import subprocess
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path

from wayfi.backend.pose2 import Pose2, compose_all
from wayfi.frontends.measurements import Measurement, Sensor
from wayfi.recordings.files.tum import read_tum
from wayfi.recordings.mcap.blocks import Record
from wayfi.recordings.mcap.recording import open_recording
from wayfi.recordings.ros.codec import decode
from wayfi.recordings.ros.codec_error import CodecError
from wayfi.recordings.ros.messages import DEFAULT_TOPICS
from wayfi.recordings.ros.topics import Encoding
from wayfi.recordings.trajectory import Trajectory

ROOT = Path(__file__).resolve().parents[3]
SHARED = ROOT.parent / "shared"
KEPT = ROOT / "build" / "benchmarks" / "localization"
SIMULATOR = SHARED / "tools" / "other_worlds.py"
SENSORS = {topic: sensor for sensor, topic in DEFAULT_TOPICS.items()}


@dataclass(frozen=True)
class Drive:
    """A recording with its truth, in `folder`; `T_old_base` is the base_link of the truth in that of the file."""

    folder: Path
    T_old_base: Pose2 = Pose2()

    @property
    def name(self) -> str:
        """The folder's name."""
        return self.folder.name

    @property
    def recording(self) -> Path:
        """The recording."""
        return self.folder / "recording.mcap"

    @cached_property
    def truth(self) -> Trajectory:
        """Where the robot was."""
        truth = read_tum(self.folder / "truth.tum")
        return Trajectory(truth.stamps_ns, compose_all(truth.poses, self.T_old_base.array()))

    def seen_from(self, T_old_base: Pose2) -> "Drive":
        """The same drive with the truth of a base_link that is elsewhere on the robot."""
        return Drive(self.folder, T_old_base)


def simulated(kept: Path, world: str, seed: int, session: int, *options: str) -> Drive:
    """A drive of the other simulator, made in `kept`/drives if it is not there; `session` 0 is the first day."""
    marks = "".join(mark for option, mark in (("--rough", "r"), ("--hard-wifi", "h")) if option in options)
    folder = kept / "drives" / f"{world}{marks}-{seed}-s{session}"
    if not folder.exists():
        unfinished = folder.with_suffix(f".{os.getpid()}.part")
        unfinished.parent.mkdir(parents=True, exist_ok=True)
        command = [sys.executable, str(SIMULATOR), world, str(unfinished), "--seed", str(seed), "--no-log"]
        subprocess.run([*command, "--session", str(session), *options], check=True, stdout=subprocess.DEVNULL)
        unfinished.rename(folder)
    return Drive(folder)


@lru_cache(maxsize=1)
def records(path: Path) -> list[Record]:
    """All records of a recording, in log-time order."""
    return list(open_recording(path))


def stream(
    all_records: Sequence[Record], start_ns: int, end_ns: int, left_out: Sequence[Sensor] = ()
) -> Iterator[Measurement]:
    """What a robot that is switched on at `start_ns` hears until `end_ns`: /tf_static, then everything from there."""
    for record in all_records:
        sensor = SENSORS.get(record.topic)
        if sensor is None or sensor in left_out or record.log_time_ns >= end_ns:
            continue
        if sensor is not Sensor.TF_STATIC and record.log_time_ns < start_ns:
            continue
        try:
            yield decode(record.data, sensor, Encoding(record.encoding))
        except CodecError:
            continue
