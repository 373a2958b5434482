"""The process of the estimation, seen from the daemon: one thread feeds it, another receives its reports."""

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
PIPE_BYTES = 1 << 20  # some seconds of a planar laser, recorded and not yet processed
CHECKPOINT_EVERY = 2000  # messages: a second or two of work, which a restart has to repeat


class EstimatorProcess:
    """Feeds its process the items of `backlog`, each recorded before it is sent; calls `wake` when there are `reports`.

    `ended` says whether the process has ended.
    """

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

    def feed(self, ready: Ready) -> None:
        """Feed the process from now on, after it reported `ready`."""
        self._checkpoint, self._since_checkpoint = ready.checkpoint, ready.since
        self._feeder.start()

    def reports(self) -> list[Report]:
        """What the process has reported since the last call."""
        return [self._reports.popleft() for _ in range(len(self._reports))]

    def close(self) -> None:
        """Kill the process, if it has not ended, and wait for the threads."""
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
                    self._recorder.maintain()
                else:
                    self._send(item)
        except (BrokenPipeError, OSError):
            self.ended = True

    def _send(self, item: Received | ControlRecord | Request) -> None:
        if isinstance(item, Finish):
            self._recorder.close()
        elif isinstance(item, Received | ControlRecord):
            self._recorder.write(item)
        self._outgoing.send(item)
        self._since_checkpoint += isinstance(item, Received)
        if self._since_checkpoint >= CHECKPOINT_EVERY:
            self._since_checkpoint = 0
            self._request_checkpoint()

    def _request_checkpoint(self) -> None:
        """Have a checkpoint written; where a part of the black box is full, the next begins with the control record.

        So no older part is needed to resume.
        """
        self._checkpoint += 1
        record = ControlRecord(ControlKind.CHECKPOINT, self._checkpoint)
        self._recorder.rotate_if_due()
        self._recorder.write(record)
        self._recorder.flush()
        self._outgoing.send(record)


def _spawn() -> tuple["subprocess.Popen[bytes]", Connection, Connection]:
    """The process, the pipe to it and the pipe from it."""
    its_incoming, outgoing = os.pipe()
    incoming, its_outgoing = os.pipe()
    if hasattr(fcntl, "F_SETPIPE_SZ"):
        fcntl.fcntl(outgoing, fcntl.F_SETPIPE_SZ, PIPE_BYTES)
    command = [sys.executable, "-m", "wayfi.service.daemon.estimator", str(its_incoming), str(its_outgoing)]
    process = subprocess.Popen(command, pass_fds=(its_incoming, its_outgoing), stdin=subprocess.DEVNULL)
    os.close(its_incoming)
    os.close(its_outgoing)
    return process, Connection(outgoing, readable=False), Connection(incoming, writable=False)
