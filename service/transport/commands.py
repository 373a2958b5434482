"""What a person or a program asks of the daemon: queryables that answer in JSON."""

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


class Command:
    """A command that waits for its answer; `argument` is empty without."""

    def __init__(self, name: Name, argument: str, query: zenoh.Query) -> None:
        self.name = name
        self.argument = argument
        self._query = query

    def answer(self, ok: bool, message: str) -> None:
        """Say what became of it; to somebody who has left, nothing."""
        with suppress(zenoh.ZError), self._query as query:
            query.reply(
                query.key_expr,
                json.dumps({"ok": ok, "message": message}),
                encoding=zenoh.Encoding.APPLICATION_JSON,
            )


class Commands(Closing):
    """Collects commands, at most `MOST_WAITING`, and calls `wake` for each; a context manager. Raises ZenohError."""

    def __init__(self, session: zenoh.Session, config: ZenohConfig, wake: Callable[[], None]) -> None:
        self._wake = wake
        self._waiting: deque[Command] = deque()
        with ExitStack() as opened:
            for name in Name:
                key = key_of(config, f"wayfi/command/{name}")
                opened.enter_context(session.declare_queryable(key, self._taker(name)))
            self._opened = opened.pop_all()

    def close(self) -> None:
        """Answer what still waits that the daemon is stopping."""
        self._opened.close()
        for command in self.take():
            command.answer(False, "the daemon is stopping")

    def take(self) -> list[Command]:
        """The commands that have come since this was last asked."""
        return [self._waiting.popleft() for _ in range(len(self._waiting))]

    def _taker(self, name: Name) -> Callable[[zenoh.Query], None]:
        def take(query: zenoh.Query) -> None:
            command = Command(name, _argument(query), query)
            if len(self._waiting) >= MOST_WAITING:
                command.answer(False, "too many commands wait already")
                return
            self._waiting.append(command)
            self._wake()

        return take


def _argument(query: zenoh.Query) -> str:
    """The payload as text or JSON string, or the selector's parameters: `?localization` or `?mode=localization`."""
    payload = query.payload.to_bytes().decode(errors="replace") if query.payload is not None else ""
    text = payload.strip() or str(query.parameters).partition("=")[2] or str(query.parameters)
    return text.strip().strip('"').lower()
