"""What a black box holds beside the messages: marks of what the daemon did between two of them, as JSON."""

import json
from dataclasses import asdict, dataclass
from enum import StrEnum

from wayfi.backend.errors import WayfiError
from wayfi.recordings.ros.topics import CONTROL_TOPIC


class ControlRecordError(WayfiError):
    """A mark that no daemon wrote."""


class ControlKind(StrEnum):
    """What was done."""

    ADOPT = "adopt"
    CHECKPOINT = "checkpoint"
    AWAY = "away"
    COMMAND = "command"


@dataclass(frozen=True, slots=True)
class ControlRecord:
    """One thing done: estimate or checkpoint `number`, ms away, or the command whose name is `text`."""

    kind: ControlKind
    number: int = 0
    text: str = ""

    def to_json(self) -> bytes:
        """The mark as bytes."""
        return json.dumps(asdict(self)).encode()


def parse_control_record(data: bytes) -> ControlRecord:
    """The control record of `ControlRecord.to_json`'s bytes. Raises ControlRecordError."""
    try:
        fields = json.loads(data)
        return ControlRecord(ControlKind(fields["kind"]), int(fields["number"]), str(fields["text"]))
    except (ValueError, KeyError, TypeError) as error:
        raise ControlRecordError(f"{CONTROL_TOPIC}: {data[:80]!r} is no mark: {error}") from None
