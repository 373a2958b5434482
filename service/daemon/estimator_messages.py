"""What the daemon and its estimation, a process of its own, say to each other."""

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
from wayfi.service.transport.message_queue import MessageQueue, Received


@dataclass(frozen=True, slots=True)
class Start:
    """The first word: what to estimate with, in which folder, and whether to go on with the drive that is in it."""

    config: Config
    calibration: Calibration | None
    folder: Path
    resumes: bool


@dataclass(frozen=True, slots=True)
class Ready:
    """The estimation takes messages from now on; nothing that was fed to the drive so far is missing if it is `whole`.

    `checkpoint` is the number of the drive's newest, 0 without, and `since` how many messages have come after it.
    """

    checkpoint: int
    since: int
    whole: bool


@dataclass(frozen=True, slots=True)
class Save:
    """Asks for the results of the drive so far, which goes on."""


@dataclass(frozen=True, slots=True)
class Finish:
    """Asks for the end; `dropped` never came to the estimation, `report` goes into report.json as it is."""

    dropped: Mapping[str, Mapping[str, int]]
    report: Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class Written:
    """The results are in the folder, `poses` lines of trajectory; or why not. Answers Finish."""

    poses: int
    error: str = ""


@dataclass(frozen=True, slots=True)
class Saved:
    """The same, of a drive that goes on. Answers Save."""

    written: Written


@dataclass(slots=True)
class News:
    """What became known: an estimate, events, drops in all, and the map as an OccupancyGrid's bytes."""

    estimate: Estimate | None = None
    dropped: Drops | None = None
    complaints: list[str] = field(default_factory=list)
    events: list[Event] = field(default_factory=list)
    map_cdr: bytes | None = None


Request = Save | Finish
Backlog = MessageQueue[Received | ControlRecord | Request]  # what the estimation has still to be fed
Report = Ready | News | Saved | Written
