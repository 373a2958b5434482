"""The process of the estimation: a heavy step in it delays no pose of the daemon's.

It is fed what the black box holds, in that order, and reports what is new. It ends with the daemon, however that ends.
"""

import ctypes
import os
import signal
import sys
import time
from contextlib import suppress
from multiprocessing.connection import Connection
from typing import Any

from wayfi.backend.errors import WayfiError
from wayfi.frontends.closures.vetoes import VetoError
from wayfi.frontends.event_making import grid_event
from wayfi.frontends.events import Event, FloorChanged, GridRedrawn, KeyframeAdded, PosePublished, StateChanged, Warned
from wayfi.recordings.files.map_files import write_grid
from wayfi.recordings.files.map_folder import MapError
from wayfi.recordings.files.result_folder import MAP
from wayfi.recordings.map.saving import MapSaver, name_of_map
from wayfi.recordings.mcap.parts import BLACKBOX, parts_of
from wayfi.service.blackbox.checkpoint import write_checkpoint
from wayfi.service.daemon.estimator_messages import (
    Compiling,
    Edited,
    Finish,
    Ready,
    Refused,
    Save,
    Saved,
    Start,
    Update,
    Written,
)
from wayfi.service.daemon.live_log import LiveLog
from wayfi.service.daemon.recovery import recover
from wayfi.service.drive.control_records import RESTORE, ControlKind, ControlRecord
from wayfi.service.drive.counters import merged
from wayfi.service.drive.live_drive import LiveDrive
from wayfi.service.drive.results import Source, hash_of, write_results
from wayfi.service.drive.warm_up import warm_up
from wayfi.service.process.collection import collect_seldom, loaded_objects_left_alone
from wayfi.service.process.compilation import watch_compilation
from wayfi.service.transport.message_queue import Received
from wayfi.service.transport.output_messages import map_message

MAP_KEYFRAMES = 30  # new ones, for which the map is saved: 15 m, half a minute of driving; a save takes 0.05 s
MAP_GROWN = 0.03  # of its keyframes, which are new, in a large map: what a save costs is by what was added
NICENESS = 5  # the daemon's poses come first
PR_SET_PDEATHSIG = 1
REPORTED = (StateChanged, FloorChanged, Warned)


class Estimator:
    """Processes what it receives from `incoming` until Finish, and reports to `outgoing`.

    Raises EOFError or BrokenPipeError where the daemon has ended, MapError where the map to localise in is missing.
    """

    def __init__(self, incoming: Connection, outgoing: Connection) -> None:
        self._incoming = incoming
        self._outgoing = outgoing
        start: Start = incoming.recv()
        self._config, self._folder = start.config, start.folder
        self._begun_s = time.monotonic()
        self._warnings: list[str] = []
        self._reported_drops = 0
        self._new_keyframes, self._worth_saving = 0, MAP_KEYFRAMES
        self._log = LiveLog(start.config.rerun, start.folder, self._warnings.append)
        self._live, self._ready = self._begin(start)
        self._begin_part_if_due()

    def run(self) -> None:
        """Process everything up to the end of the drive."""
        self._outgoing.send(self._ready)
        self._publish_known_map()
        while True:
            match self._incoming.recv():
                case Received() as message:
                    events, published = self._live.feed(message.sensor, message.encoding, message.data, message.topic)
                    self._report(events, published)
                case ControlRecord(kind=ControlKind.CHECKPOINT, number=number):
                    self._checkpoint(number)
                case ControlRecord() as record if record.edits:
                    self._edit(record)
                case ControlRecord() as record:
                    self._report(self._live.apply(record), None)
                case Save():
                    self._outgoing.send(self._save())
                case Finish() as finish:
                    self._outgoing.send(self._finish(finish))
                    return

    def _begin(self, start: Start) -> tuple[LiveDrive, Ready]:
        known = start.map.load() if start.map else None
        if start.resumes:
            found = recover(start.folder, start.config, start.calibration, self._log, known)
            return found.live, Ready(found.live.checkpoints, found.replayed, found.whole, found.live.drive.mode)
        with watch_compilation(self._report_compiling):
            warm_up(in_map=known is not None)
        live = LiveDrive(start.config, start.calibration, self._log, known)
        return live, Ready(0, 0, True, live.drive.mode)

    def _publish_known_map(self) -> None:
        """Publish the map that the drive localises in, if it does: others need it before the robot is found."""
        if (floor := self._live.drive.counters.floor) != 0:
            self._outgoing.send(Update(events=[FloorChanged(0, floor)]))
        drawn = self._live.drive.history() if self._live.drive.former else []
        for event in drawn:
            if isinstance(event, GridRedrawn):
                self._outgoing.send(Update(map_cdr=map_message(event, self._config.map, self._config.frames.map)))

    def _report_compiling(self, number: int, total: int) -> None:
        if number == 1:
            self._outgoing.send(Compiling(total))

    def _edit(self, record: ControlRecord) -> None:
        """Take a closure out or put it back, and reply."""
        done = "restored" if record.text == RESTORE else "vetoed"
        reply = Edited(True, f"closure {record.number} is {done}, and the map optimised anew")
        events: list[Event] = []
        try:
            events = self._live.edit(record)
        except VetoError as error:
            reply = Edited(False, str(error))
        self._report(events, None)
        self._outgoing.send(reply)

    def _checkpoint(self, number: int) -> None:
        if self._new_keyframes:  # a robot that stands has its last metres saved as well; a checkpoint takes longer
            self._save_map()
        try:
            write_checkpoint(self._folder, number, self._live.checkpoint(number))
        except OSError as error:
            self._warnings.append(f"no checkpoint: {error.strerror}; a restart would begin at the one before")

    def _save_map(self) -> None:
        """Save what the map has become since the last time, so that a daemon that is killed leaves a map."""
        self._new_keyframes = 0
        made = self._live.drive.pipeline.made_map()
        if made is None:
            return
        self._worth_saving = max(MAP_KEYFRAMES, round(MAP_GROWN * len(made.keyframes)))
        try:
            with self._live.drive.timer("files"):
                self._saver_of(self._live).save(made)
        except MapError as error:
            self._warnings.append(f"the map was not saved: {error}")

    def _saver_of(self, live: LiveDrive) -> MapSaver:
        folder = self._folder / MAP
        live.saver = live.saver or MapSaver(
            folder, self._config.map, name_of_map(folder) or live.drive.former, self._config.frames
        )
        return live.saver

    def _report(self, events: list[Event], published: PosePublished | None) -> None:
        """Report what the daemon does not know yet, then count and log all events."""
        drive = self._live.drive
        update = Update(self._live.new_estimate(), warnings=self._warnings.copy())
        self._warnings.clear()
        if drive.counters.drops != self._reported_drops:
            self._reported_drops = drive.counters.drops
            update.dropped = merged(drive.counters.dropped)
        for event in events:
            if isinstance(event, REPORTED) or (isinstance(event, PosePublished) and event is not published):
                update.events.append(event)
            elif isinstance(event, GridRedrawn):
                update.map_cdr = map_message(event, self._config.map, self._config.frames.map)
                self._write_map(event)
        if update != Update():
            self._outgoing.send(update)
        drive.show(events)
        self._new_keyframes += sum(isinstance(event, KeyframeAdded) for event in events)
        if self._new_keyframes >= self._worth_saving:
            self._save_map()
        self._begin_part_if_due()

    def _write_map(self, drawn: GridRedrawn) -> None:
        """Leave the newest map in the folder, should the run be cut off; the recorder warns of a full disk."""
        with suppress(OSError):
            write_grid(self._folder, drawn, self._config.map)

    def _begin_part_if_due(self) -> None:
        if self._log.due:
            self._log.begin(self._live.drive.history())

    def _save(self) -> Saved:
        """Write the results of a copy of the drive; the drive itself goes on."""
        return Saved(self._write_results(self._live.copy(), {}, {}))

    def _finish(self, finish: Finish) -> Written:
        return self._write_results(self._live, finish.dropped, finish.report)

    def _write_results(self, live: LiveDrive, dropped: Any, extra: Any) -> Written:  # noqa: ANN401 - as in Finish
        drive = live.drive
        result = drive.finish()
        floor = drive.counters.floor or 0
        drawn = grid_event(0, result.building.grid_of(floor), floor)
        self._outgoing.send(Update(map_cdr=map_message(drawn, self._config.map, self._config.frames.map)))
        for topic, reasons in dropped.items():
            drive.counters.drop_many(topic, reasons)
        seconds = time.monotonic() - self._begun_s
        try:
            source = Source(seconds, seconds, hash_of(parts_of(self._folder, BLACKBOX)), [])
            write_results(self._folder, drive, result, source, extra, self._saver_of(live))
        except (OSError, WayfiError) as error:
            why = error.strerror if isinstance(error, OSError) and error.strerror else error
            return Written(len(result.stamps_ns), f"{self._folder}: the results cannot be written: {why}")
        return Written(len(result.stamps_ns))


def main() -> None:
    """Serve the daemon; the arguments are the file descriptors of the pipes from it and to it."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    os.nice(NICENESS)
    collect_seldom()
    numbers = (int(word) for word in sys.argv[1:3])
    incoming, outgoing = Connection(next(numbers), writable=False), Connection(next(numbers), readable=False)
    try:
        estimator = Estimator(incoming, outgoing)
        with loaded_objects_left_alone():
            estimator.run()
    except MapError as error:
        outgoing.send(Refused(str(error)))
    except (EOFError, BrokenPipeError):
        os._exit(1)


if __name__ == "__main__":
    main()
