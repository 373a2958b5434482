"""Control records: what the daemon did between two messages, as JSON in its black box."""

import json
from dataclasses import asdict, dataclass
from enum import StrEnum

from wayfi.backend.errors import WayfiError
from wayfi.recordings.ros.topics import CONTROL_TOPIC


class ControlRecordError(WayfiError):
    """Bytes that are not a control record."""


class ControlKind(StrEnum):
    """What the daemon did."""

    ADOPT = "adopt"  # based the live pose on an estimate
    CHECKPOINT = "checkpoint"  # saved the drive
    AWAY = "away"  # missed messages, and resumed
    MODE = "mode"  # made the map, or localised in it, from then on
    COMMAND = "command"  # executed a command


VETO, RESTORE = "veto", "restore"  # the commands that edit the graph


@dataclass(frozen=True, slots=True)
class ControlRecord:
    """One action: `number` is that of the estimate, checkpoint or closure, or the ms away.

    `text` names the command or mode.
    """

    kind: ControlKind
    number: int = 0
    text: str = ""

    @property
    def edits(self) -> bool:
        """Whether it is a command that edits the graph."""
        return self.kind is ControlKind.COMMAND and self.text in (VETO, RESTORE)

    def to_json(self) -> bytes:
        """The record as JSON in UTF-8."""
        return json.dumps(asdict(self)).encode()


def parse_control_record(data: bytes) -> ControlRecord:
    """The record that `ControlRecord.to_json` made these bytes of. Raises ControlRecordError."""
    try:
        fields = json.loads(data)
        return ControlRecord(ControlKind(fields["kind"]), int(fields["number"]), str(fields["text"]))
    except (ValueError, KeyError, TypeError) as error:
        raise ControlRecordError(f"{CONTROL_TOPIC}: {data[:80]!r} is no control record: {error}") from None
