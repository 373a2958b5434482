"""The estimation's process as the daemon sees it: one thread feeds it, another hears what it says."""

import fcntl
import os
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Callable
from multiprocessing.connection import Connection

from wayfi.service.blackbox.recorder import Recorder
from wayfi.service.daemon.estimator_messages import Backlog, Finish, Ready, Report, Request, Start
from wayfi.service.drive.control_records import ControlKind, ControlRecord
from wayfi.service.transport.message_queue import Received

IDLE_S = 0.1
PIPE_BYTES = 1 << 20  # some seconds of a planar laser: recorded, and on their way to an estimation that is busy
CHECKPOINT_EVERY = 2000  # messages: a second or two of work, which a restart has to do again


class Estimation:
    """Feeds its process what `backlog` holds, recorded before it is sent; calls `wake` when there are `reports`."""

    def __init__(self, start: Start, backlog: Backlog, recorder: Recorder, wake: Callable[[], None]) -> None:
        self._backlog = backlog
        self._recorder = recorder
        self._wake = wake
        self._reports: deque[Report] = deque()
        self._checkpoint = 0
        self._since_checkpoint = 0
        self._process, self._outgoing, self._incoming = _spawn()
        self._outgoing.send(start)
        self.ended = False
        self._reader = threading.Thread(target=self._read, name="estimation reader", daemon=True)
        self._feeder = threading.Thread(target=self._feed_all, name="estimation feeder", daemon=True)
        self._reader.start()

    def begin(self, ready: Ready) -> None:
        """Feed from now on."""
        self._checkpoint, self._since_checkpoint = ready.checkpoint, ready.since
        self._feeder.start()

    def reports(self) -> list[Report]:
        """What the process has said since this was last asked."""
        return [self._reports.popleft() for _ in range(len(self._reports))]

    def close(self) -> None:
        """End the process, if it has not ended."""
        self._process.kill()
        self._process.wait()
        self._reader.join()
        if self._feeder.ident is not None:
            self._feeder.join()
        self._outgoing.close()
        self._incoming.close()

    def _read(self) -> None:
        try:
            while True:
                self._reports.append(self._incoming.recv())
                self._wake()
        except (EOFError, OSError):
            self.ended = True
            self._wake()

    def _feed_all(self) -> None:
        try:
            while not self.ended:
                item = self._backlog.pop(IDLE_S)
                if item is None:
                    self._recorder.look_after()
                else:
                    self._feed(item)
        except (BrokenPipeError, OSError):
            self.ended = True

    def _feed(self, item: Received | ControlRecord | Request) -> None:
        if isinstance(item, Finish):
            self._recorder.close()
        elif isinstance(item, Received | ControlRecord):
            self._recorder.write(item)
        self._outgoing.send(item)
        self._since_checkpoint += isinstance(item, Received)
        if self._since_checkpoint >= CHECKPOINT_EVERY:
            self._since_checkpoint = 0
            self._ask_for_checkpoint()

    def _ask_for_checkpoint(self) -> None:
        """A new part of the black box begins with its mark, so that older parts are not needed to go on from it."""
        self._checkpoint += 1
        mark = ControlRecord(ControlKind.CHECKPOINT, self._checkpoint)
        self._recorder.rotate_if_due()
        self._recorder.write(mark)
        self._recorder.flush()
        self._outgoing.send(mark)


def _spawn() -> tuple["subprocess.Popen[bytes]", Connection, Connection]:
    """The process, and the ends of its two pipes: what goes out to it, what comes in from it."""
    its_incoming, outgoing = os.pipe()
    incoming, its_outgoing = os.pipe()
    if hasattr(fcntl, "F_SETPIPE_SZ"):
        fcntl.fcntl(outgoing, fcntl.F_SETPIPE_SZ, PIPE_BYTES)
    command = [sys.executable, "-m", "wayfi.service.daemon.estimator", str(its_incoming), str(its_outgoing)]
    process = subprocess.Popen(command, pass_fds=(its_incoming, its_outgoing), stdin=subprocess.DEVNULL)
    os.close(its_incoming)
    os.close(its_outgoing)
    return process, Connection(outgoing, readable=False), Connection(incoming, writable=False)
