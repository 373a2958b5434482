"""`wayfi import`: a recording of any kind as one MCAP file of ROS 2 messages."""

from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from wayfi.backend.errors import WayfiError
from wayfi.recordings.bags.opening import open_any_recording
from wayfi.recordings.mcap.recording import Recording
from wayfi.recordings.mcap.writer import McapWriter
from wayfi.recordings.ros.foreign import ROS1


class ImportFailedError(WayfiError):
    """A recording that cannot be converted, or a file that cannot be written."""


@dataclass(frozen=True, slots=True)
class ImportSummary:
    """Messages written by topic, those left out by type, and what was wrong with the recording."""

    messages: dict[str, int]
    left_out: dict[str, int]
    warnings: list[str]


def import_recording(path: Path, out: Path, progress: Callable[[float], None] = lambda _: None) -> ImportSummary:
    """Write the messages of the recording at `path` to the MCAP file `out`, in log-time order.

    Messages of ROS 1 types that ROS 2 has otherwise, or not at all, are left out. `out` is there only when it is whole.
    Raises RecordingError or ImportFailedError.
    """
    recording = open_any_recording(path)
    if recording.is_blackbox:
        raise ImportFailedError(f"{path} is the black box of a daemon; replay its folder as it is")
    if out.is_dir() or not out.parent.is_dir():
        raise ImportFailedError(f"{out}: cannot be written: {'it is a' if out.is_dir() else 'there is no such'} folder")
    if out.resolve() in {part.resolve() for part in recording.paths}:
        raise ImportFailedError(f"{out}: is the recording itself; name another file")
    temporary = out.with_name(f".{out.name}.part")
    try:
        messages, left_out = _write_all(recording, temporary, progress)
        temporary.replace(out)
    except OSError as error:
        raise ImportFailedError(f"{out}: cannot be written: {error.strerror}") from None
    finally:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)
    return ImportSummary(dict(messages), dict(left_out), recording.warnings)


def _write_all(recording: Recording, out: Path, progress: Callable[[float], None]) -> tuple[Counter[str], Counter[str]]:
    """Write the records; returns how many were written by topic, and left out by type."""
    messages: Counter[str] = Counter()
    left_out: Counter[str] = Counter()
    total = max(recording.message_count, 1)
    with McapWriter(out) as writer:
        for number, record in enumerate(recording):
            if record.encoding == ROS1:
                left_out[record.type_name] += 1
                continue
            writer.write(record.topic, record.type_name, record.encoding, record.log_time_ns, record.data)
            messages[record.topic] += 1
            if number % 100 == 0:
                progress(number / total)
    progress(1.0)
    return messages, left_out
