"""The daemon's log: one line of `time level event key=value ...` on stderr for each thing worth knowing."""

import json
import sys
from datetime import UTC, datetime


class LogLines:
    """Writes the lines; with `quiet` only those that warn."""

    def __init__(self, quiet: bool = False) -> None:
        self._quiet = quiet

    def info(self, event: str, **fields: object) -> None:
        """Something happened as it should."""
        if not self._quiet:
            _write("info", event, fields)

    def warning(self, event: str, **fields: object) -> None:
        """Something a person should look at; the daemon goes on."""
        _write("warning", event, fields)


def _write(level: str, event: str, fields: dict[str, object]) -> None:
    moment = datetime.now(UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")
    words = [moment, level, event, *(f"{key}={_quoted(str(value))}" for key, value in fields.items())]
    sys.stderr.write(" ".join(words) + "\n")
    sys.stderr.flush()


def _quoted(text: str) -> str:
    """`text` as it is where that is one plain word, else in JSON's quotes, on one line."""
    plain = text.isprintable() and text and not set(text) & set(' "=')
    return text if plain else json.dumps(text)
