"""Commands to the daemon: queryables that reply in JSON."""

import json
from collections import deque
from collections.abc import Callable
from contextlib import ExitStack, suppress
from enum import StrEnum

import zenoh

from wayfi.recordings.closing import Closing
from wayfi.service.config import ZenohConfig
from wayfi.service.transport.zenoh_session import key_of

MOST_WAITING = 100


class Name(StrEnum):
    """The commands."""

    PAUSE = "pause"
    RESUME = "resume"
    RESET = "reset"
    SAVE = "save"
    MODE = "mode"
    VETO = "veto"
    RESTORE = "restore"


class Command:
    """A command that waits for its answer; `argument` is empty where none was given."""

    def __init__(self, name: Name, argument: str, query: zenoh.Query) -> None:
        self.name = name
        self.argument = argument
        self._query = query

    def answer(self, ok: bool, message: str) -> None:
        """Reply whether it succeeded, with a message for a person; nothing where whoever asked has left."""
        with suppress(zenoh.ZError), self._query as query:
            query.reply(
                query.key_expr,
                json.dumps({"ok": ok, "message": message}),
                encoding=zenoh.Encoding.APPLICATION_JSON,
            )


class Commands(Closing):
    """Receives commands, of which at most `MOST_WAITING` wait, and calls `wake` for each; a context manager.

    Raises ZenohError.
    """

    def __init__(self, session: zenoh.Session, config: ZenohConfig, wake: Callable[[], None]) -> None:
        self._wake = wake
        self._waiting: deque[Command] = deque()
        with ExitStack() as opened:
            for name in Name:
                key = key_of(config, f"wayfi/command/{name}")
                opened.enter_context(session.declare_queryable(key, self._receiver(name)))
            self._opened = opened.pop_all()

    def close(self) -> None:
        """Undeclare everything, and refuse the commands that still wait."""
        self._opened.close()
        while command := self.pop():
            command.answer(False, "the daemon is stopping")

    def pop(self) -> Command | None:
        """Remove and return the oldest command that waits, None without one."""
        return self._waiting.popleft() if self._waiting else None

    def _receiver(self, name: Name) -> Callable[[zenoh.Query], None]:
        def receive(query: zenoh.Query) -> None:
            command = Command(name, _argument(query), query)
            if len(self._waiting) >= MOST_WAITING:
                command.answer(False, "too many commands wait already")
                return
            self._waiting.append(command)
            self._wake()

        return receive


def _argument(query: zenoh.Query) -> str:
    """The payload as text or JSON string, or the selector's parameters: `?localization` or `?mode=localization`."""
    payload = query.payload.to_bytes().decode(errors="replace") if query.payload is not None else ""
    text = payload.strip() or str(query.parameters).partition("=")[2] or str(query.parameters)
    return text.strip().strip('"').lower()
