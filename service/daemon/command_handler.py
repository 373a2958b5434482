"""Does what commands ask, and answers each."""

from collections import deque

from wayfi.service.blackbox.run_folder import RunFolder
from wayfi.service.daemon.estimator_messages import Backlog, Save, Saved
from wayfi.service.drive.control_records import ControlKind, ControlRecord
from wayfi.service.process.log_lines import LogLines
from wayfi.service.transport.commands import Command, Name


class CommandHandler:
    """Commands to the daemon of one run; what changes something is put into its black box by way of `backlog`."""

    def __init__(self, folder: RunFolder, backlog: Backlog, log: LogLines) -> None:
        self._folder = folder
        self._backlog = backlog
        self._log = log
        self._saving: deque[Command] = deque()
        self.paused = False
        self.reset = False

    def obey(self, command: Command) -> None:
        """Do it; the answer to `save` follows when the files are written."""
        self._log.info("command", name=command.name, argument=command.argument)
        match command.name:
            case Name.PAUSE | Name.RESUME:
                self._pause(command)
            case Name.SAVE:
                self._saving.append(command)
                self._record(command)
                self._backlog.put(Save())
            case Name.RESET:
                self.reset = True
                self._record(command)
                command.answer(True, f"{self._folder.path} is being closed; a new run begins")
            case Name.MODE:
                known = command.argument == "mapping"
                wrong = f"no mode {command.argument!r}: this daemon maps, and knows the mode 'mapping' alone"
                command.answer(known, "mapping" if known else wrong)

    def take_saved(self, saved: Saved) -> None:
        """Answer the oldest command to save."""
        if self._saving:
            error = saved.written.error
            self._saving.popleft().answer(not error, error or f"written to {self._folder.path}")

    def give_up_saving(self, why: str) -> None:
        """Tell all that wait for their files that they will not come."""
        while self._saving:
            self._saving.popleft().answer(False, why)

    def _pause(self, command: Command) -> None:
        paused = command.name is Name.PAUSE
        if paused != self.paused:
            self.paused = paused
            self._record(command)
        command.answer(True, "paused: what comes in is dropped" if paused else "running")

    def _record(self, command: Command) -> None:
        self._backlog.put(ControlRecord(ControlKind.COMMAND, text=command.name))
