"""The daemon's log on stderr, one line an event.

A terminal gets `time level event key=value ...`, anything else JSON with `time`, `level`, `event` and the same keys.
"""

import json
import sys
from datetime import UTC, datetime


class LogLines:
    """Writes the lines; with `quiet` only warnings."""

    def __init__(self, quiet: bool = False) -> None:
        self._quiet = quiet
        self._line = _plain if sys.stderr.isatty() else _json

    def info(self, event: str, **fields: object) -> None:
        """Log an expected event."""
        if not self._quiet:
            self._write("info", event, fields)

    def warning(self, event: str, **fields: object) -> None:
        """Log an event that a person should look at; the daemon goes on."""
        self._write("warning", event, fields)

    def _write(self, level: str, event: str, fields: dict[str, object]) -> None:
        moment = datetime.now(UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")
        sys.stderr.write(self._line(moment, level, event, fields) + "\n")
        sys.stderr.flush()


def _plain(moment: str, level: str, event: str, fields: dict[str, object]) -> str:
    return " ".join([moment, level, event, *(f"{key}={_quoted(str(value))}" for key, value in fields.items())])


def _json(moment: str, level: str, event: str, fields: dict[str, object]) -> str:
    numbers_kept = {key: value if isinstance(value, int | float) else str(value) for key, value in fields.items()}
    return json.dumps({"time": moment, "level": level, "event": event, **numbers_kept})


def _quoted(text: str) -> str:
    """`text` unchanged where it is one plain word, else as a JSON string, on one line."""
    plain = text.isprintable() and text and not set(text) & set(' "=')
    return text if plain else json.dumps(text)
