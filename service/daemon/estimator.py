"""The estimation, in a process of its own: a heavy step there holds up no pose here.

It is fed what the black box holds, in its order, and says what became known. It ends with the daemon, whichever way.
"""

import ctypes
import os
import pickle
import signal
import sys
import time
from contextlib import suppress
from multiprocessing.connection import Connection
from typing import Any

from wayfi.backend.errors import WayfiError
from wayfi.frontends.events import Event, GridRedrawn, PosePublished, StateChanged, Warned
from wayfi.recordings.files.map_files import write_drawn
from wayfi.recordings.mcap.parts import BLACKBOX, parts_of
from wayfi.service.blackbox.checkpoint import write_checkpoint
from wayfi.service.daemon.estimator_messages import Finish, News, Ready, Save, Saved, Start, Written
from wayfi.service.daemon.live_log import LiveLog
from wayfi.service.daemon.recovery import recover
from wayfi.service.drive.control_records import ControlKind, ControlRecord
from wayfi.service.drive.counters import merged
from wayfi.service.drive.live_drive import LiveDrive
from wayfi.service.drive.results import Source, hash_of, write_results
from wayfi.service.drive.warm_up import warm_up
from wayfi.service.transport.message_queue import Received
from wayfi.service.transport.output_messages import map_message

NICER = 5  # than the daemon, whose poses come first
PR_SET_PDEATHSIG = 1
TOLD = (StateChanged, Warned)


class Estimator:
    """Takes what comes in `incoming` until it ends or asks to finish, and says in `outgoing` what becomes of it."""

    def __init__(self, incoming: Connection, outgoing: Connection) -> None:
        self._incoming = incoming
        self._outgoing = outgoing
        start: Start = incoming.recv()
        self._config, self._folder = start.config, start.folder
        self._begun_s = time.monotonic()
        self._complaints: list[str] = []
        self._drops_told = 0
        self._log = LiveLog(start.config.rerun, start.folder, self._complaints.append)
        self._live, self._ready = self._begin(start)
        self._begin_part_if_due()

    def run(self) -> None:
        """Work until the end."""
        self._outgoing.send(self._ready)
        while True:
            match self._incoming.recv():
                case Received() as message:
                    events, published = self._live.feed(message.sensor, message.encoding, message.data)
                    self._tell(events, published)
                case ControlRecord(kind=ControlKind.CHECKPOINT, number=number):
                    self._checkpoint(number)
                case ControlRecord() as mark:
                    self._tell(self._live.obey(mark), None)
                case Save():
                    self._outgoing.send(self._save())
                case Finish() as finish:
                    self._outgoing.send(self._finish(finish))
                    return

    def _begin(self, start: Start) -> tuple[LiveDrive, Ready]:
        if start.resumes:
            back = recover(start.folder, start.config, start.calibration, self._log)
            return back.live, Ready(back.live.checkpoints, back.replayed, back.whole)
        warm_up(start.config)
        return LiveDrive(start.config, start.calibration, self._log), Ready(0, 0, whole=True)

    def _checkpoint(self, number: int) -> None:
        try:
            write_checkpoint(self._folder, number, self._live.checkpoint(number))
        except OSError as error:
            self._complaints.append(f"no checkpoint: {error.strerror}; a restart would begin at the one before")

    def _tell(self, events: list[Event], published: PosePublished | None) -> None:
        """Say what the daemon does not know yet, then show it all."""
        drive = self._live.drive
        news = News(self._live.new_estimate(), complaints=self._complaints.copy())
        self._complaints.clear()
        if drive.counters.drops != self._drops_told:
            self._drops_told = drive.counters.drops
            news.dropped = merged(drive.counters.dropped)
        for event in events:
            if isinstance(event, TOLD) or (isinstance(event, PosePublished) and event is not published):
                news.events.append(event)
            elif isinstance(event, GridRedrawn):
                news.map_cdr = map_message(event, self._config.map)
                self._keep_map(event)
        if news != News():
            self._outgoing.send(news)
        self._show(events)

    def _keep_map(self, drawn: GridRedrawn) -> None:
        """A run that is cut off leaves its last map; a disk that takes none has been complained of by the recorder."""
        with suppress(OSError):
            write_drawn(self._folder, drawn, self._config.map)

    def _show(self, events: list[Event]) -> None:
        self._live.drive.show(events)
        self._begin_part_if_due()

    def _begin_part_if_due(self) -> None:
        if self._log.due:
            self._log.begin(self._live.drive.history())

    def _save(self) -> Saved:
        """Finish a copy."""
        copy: LiveDrive = pickle.loads(pickle.dumps(self._live))
        return Saved(self._write(copy, {}, {}))

    def _finish(self, finish: Finish) -> Written:
        return self._write(self._live, finish.dropped, finish.report)

    def _write(self, live: LiveDrive, dropped: Any, extra: Any) -> Written:  # noqa: ANN401 - as in Finish
        drive = live.drive
        result = drive.finish()
        grid = result.grid
        drawn = GridRedrawn(0, grid.probability(), grid.resolution_m, grid.origin_xy_m)
        self._outgoing.send(News(map_cdr=map_message(drawn, self._config.map)))
        for topic, reasons in dropped.items():
            drive.counters.drop_many(topic, reasons)
        seconds = time.monotonic() - self._begun_s
        try:
            source = Source(seconds, seconds, hash_of(parts_of(self._folder, BLACKBOX)), [])
            write_results(self._folder, drive, result, source, extra)
        except (OSError, WayfiError) as error:
            why = error.strerror if isinstance(error, OSError) and error.strerror else error
            return Written(len(result.stamps_ns), f"{self._folder}: the results cannot be written: {why}")
        return Written(len(result.stamps_ns))


def main() -> None:
    """Serve the daemon whose two pipes are the arguments."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    os.nice(NICER)
    incoming, outgoing = (int(word) for word in sys.argv[1:3])
    try:
        Estimator(Connection(incoming, writable=False), Connection(outgoing, readable=False)).run()
    except (EOFError, BrokenPipeError):
        os._exit(1)


if __name__ == "__main__":
    main()
