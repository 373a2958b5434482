"""Executes commands to the daemon, and answers each."""

from collections import deque
from collections.abc import Callable

from wayfi.service.blackbox.run_folder import RunFolder
from wayfi.service.daemon.daemon_state import StateMachine
from wayfi.service.daemon.estimator_messages import Backlog, Edited, Save, Saved
from wayfi.service.drive.control_records import ControlKind, ControlRecord
from wayfi.service.drive.mode import Mode
from wayfi.service.process.log_lines import LogLines
from wayfi.service.transport.commands import Command, Name

MOST_DIGITS = 10  # of a closure's number


class CommandHandler:
    """Executes the commands to one run. Those that change it are recorded in the black box, through `backlog`.

    `paused` says whether received messages are to be dropped, `mode` what the drive does, as last commanded; `has_map`
    tells whether there is a map yet.
    """

    def __init__(
        self, folder: RunFolder, backlog: Backlog, machine: StateMachine, log: LogLines, has_map: Callable[[], bool]
    ) -> None:
        self._folder = folder
        self._backlog = backlog
        self._machine = machine
        self._log = log
        self._has_map = has_map
        self._saving: deque[Command] = deque()
        self._editing: deque[Command] = deque()
        self.paused = False
        self.mode = Mode.MAPPING

    def execute(self, command: Command) -> None:
        """Execute a command and answer it; `save` is answered when its files are written."""
        self._log.info("command", name=command.name, argument=command.argument)
        match command.name:
            case Name.PAUSE | Name.RESUME:
                self._pause(command)
            case Name.SAVE:
                self._saving.append(command)
                self._record(command)
                self._backlog.put(Save())
            case Name.VETO | Name.RESTORE:
                self._edit(command)
            case Name.RESET:
                self._record(command)
                self._machine.request_end()
                command.answer(True, f"{self._folder.path} is being closed; a new run begins")
            case Name.MODE:
                self._change_mode(command)

    def handle_saved(self, saved: Saved) -> None:
        """Answer the oldest `save` that waits."""
        if self._saving:
            error = saved.written.error
            self._saving.popleft().answer(not error, error or f"written to {self._folder.path}")

    def handle_edited(self, edited: Edited) -> None:
        """Answer the oldest veto or restore that waits."""
        if self._editing:
            self._editing.popleft().answer(edited.ok, edited.message)

    def fail_waiting(self, why: str) -> None:
        """Answer every command that waits with a failure."""
        for waiting in (self._saving, self._editing):
            while waiting:
                waiting.popleft().answer(False, why)

    def _edit(self, command: Command) -> None:
        """Have a closure taken out or put back; answered when that is done."""
        if not (command.argument.isascii() and command.argument.isdigit() and len(command.argument) < MOST_DIGITS):
            command.answer(False, f"{command.name} needs the number of a closure, not {command.argument[:40]!r}")
            return
        self._editing.append(command)
        self._backlog.put(ControlRecord(ControlKind.COMMAND, int(command.argument), command.name))

    def _change_mode(self, command: Command) -> None:
        if command.argument not in tuple(Mode):
            command.answer(False, f"no mode {command.argument!r}: the modes are 'mapping' and 'localization'")
        elif command.argument == self.mode:
            command.answer(True, command.argument)
        elif not self._has_map():
            command.answer(False, f"no {command.argument} without a map: drive first, or start with --map")
        else:
            self.mode = Mode(command.argument)
            self._backlog.put(ControlRecord(ControlKind.MODE, text=self.mode))
            command.answer(True, f"{self.mode}, in the map made so far")

    def _pause(self, command: Command) -> None:
        paused = command.name is Name.PAUSE
        if paused != self.paused:
            self.paused = paused
            self._record(command)
        command.answer(True, "paused: what comes in is dropped" if paused else "running")

    def _record(self, command: Command) -> None:
        self._backlog.put(ControlRecord(ControlKind.COMMAND, text=command.name))
