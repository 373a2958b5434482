"""Recovers the drive of a killed daemon from its last checkpoint and what the black box holds since."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

from wayfi.frontends.calibration import Calibration
from wayfi.recordings.log import Log, NullLog
from wayfi.recordings.mcap.blocks import Record, RecordingError
from wayfi.recordings.mcap.parts import BLACKBOX, begins_at_first, parts_of
from wayfi.recordings.mcap.recording import open_recording
from wayfi.recordings.ros.topics import CONTROL_TOPIC
from wayfi.service.blackbox.checkpoint import Checkpoint, read_checkpoint
from wayfi.service.config import Config
from wayfi.service.drive.control_records import ControlKind, ControlRecordError, parse_control_record
from wayfi.service.drive.known_map import KnownMap
from wayfi.service.drive.live_drive import LiveDrive
from wayfi.service.replay.replayers import BlackBoxReplayer


@dataclass(frozen=True, slots=True)
class Recovered:
    """A recovered drive: `replayed` messages were fed since its checkpoint; where it is `whole` none is missing."""

    live: LiveDrive
    replayed: int
    whole: bool


def recover(
    folder: Path, config: Config, calibration: Calibration | None, log: Log, known: KnownMap | None = None
) -> Recovered:
    """The drive in `folder`, in the map `known` if it began in one, as of the last message of its black box.

    It logs to `log` from then on.
    """
    checkpoint = read_checkpoint(folder)
    records = _since(folder, checkpoint) if checkpoint else None
    whole = records is not None or begins_at_first(folder, BLACKBOX)
    if checkpoint is None or records is None:
        live, records = LiveDrive(config, calibration, NullLog(), known), _records(parts_of(folder, BLACKBOX))
    else:
        live = LiveDrive.restored(checkpoint.drive, NullLog(), known)
    replayer = BlackBoxReplayer(live)
    replayed = 0
    for record in records:
        replayer.play(record)
        replayed += record.topic != CONTROL_TOPIC
    replayer.live.drive.log = log
    return Recovered(replayer.live, replayed, whole)


def _since(folder: Path, checkpoint: Checkpoint) -> Iterator[Record] | None:
    """The records after the control record of a checkpoint; None where the black box does not hold that."""
    parts = parts_of(folder, BLACKBOX)
    for k in range(len(parts) - 1, -1, -1):
        records = _records(parts[k : k + 1])
        if any(_is_of_checkpoint(record, checkpoint.number) for record in records):
            return chain(records, _records(parts[k + 1 :]))
    return None


def _is_of_checkpoint(record: Record, number: int) -> bool:
    if record.topic != CONTROL_TOPIC:
        return False
    try:
        control = parse_control_record(record.data)
    except ControlRecordError:
        return False
    return control.kind is ControlKind.CHECKPOINT and control.number == number


def _records(parts: list[Path]) -> Iterator[Record]:
    """The complete records of all parts in order; a part that cannot be read is skipped."""
    for part in parts:
        try:
            yield from open_recording(part)
        except RecordingError:
            continue
