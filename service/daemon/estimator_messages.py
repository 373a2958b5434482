"""The messages between the daemon and the process of its estimation."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from wayfi.frontends.calibration import Calibration
from wayfi.frontends.events import Event
from wayfi.frontends.odometry.live_pose import Estimate
from wayfi.service.config import Config
from wayfi.service.drive.control_records import ControlRecord
from wayfi.service.drive.counters import Drops
from wayfi.service.drive.known_map import MapReference
from wayfi.service.drive.mode import Mode
from wayfi.service.transport.message_queue import MessageQueue, Received


@dataclass(frozen=True, slots=True)
class Start:
    """The first message: the settings, the run's folder, whether to resume the drive that is in it, and its map."""

    config: Config
    calibration: Calibration | None
    folder: Path
    resumes: bool
    map: MapReference | None = None


@dataclass(frozen=True, slots=True)
class Compiling:
    """The estimation compiles `functions` first, which were not compiled on this machine before."""

    functions: int


@dataclass(frozen=True, slots=True)
class Refused:
    """The drive cannot begin, and would not if it were started again: why, in one line."""

    why: str


@dataclass(frozen=True, slots=True)
class Ready:
    """The estimation can be fed from now on. The drive is `whole` where all that it was fed so far was recovered.

    `mode` is what it does. `checkpoint` is the number of its newest checkpoint, 0 without one; `since` counts the
    messages after that.
    """

    checkpoint: int
    since: int
    whole: bool
    mode: Mode


@dataclass(frozen=True, slots=True)
class Save:
    """Requests the results of the drive so far, which goes on."""


@dataclass(frozen=True, slots=True)
class Finish:
    """Requests the end of the drive and its results.

    `dropped` counts messages that did not reach the estimation, by topic and reason; `report` is added to report.json.
    """

    dropped: Mapping[str, Mapping[str, int]]
    report: Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class Written:
    """The reply to Finish: the results are in the folder, with `poses` poses; or the `error` that prevented it."""

    poses: int
    error: str = ""


@dataclass(frozen=True, slots=True)
class Saved:
    """The reply to Save."""

    written: Written


@dataclass(frozen=True, slots=True)
class Edited:
    """The reply to the record of a veto or a restore: whether it was done, and a message for a person."""

    ok: bool
    message: str


@dataclass(slots=True)
class Update:
    """What is new: an estimate, all drops so far by topic and reason, events, the map as an OccupancyGrid in CDR."""

    estimate: Estimate | None = None
    dropped: Drops | None = None
    warnings: list[str] = field(default_factory=list)
    events: list[Event] = field(default_factory=list)
    map_cdr: bytes | None = None


Request = Save | Finish
Backlog = MessageQueue[Received | ControlRecord | Request]  # what the estimation has still to be fed
Report = Compiling | Refused | Ready | Update | Saved | Edited | Written
