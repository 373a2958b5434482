"""The daemon's log as a terminal shows it and as a collector of logs reads it."""

import json
import os
import pty
from datetime import datetime
from pathlib import Path

import pytest

from wayfi.service.process.log_lines import LogLines


def logged(quiet: bool = False) -> None:
    log = LogLines(quiet)
    log.info("ready", folder=Path("/runs/1"), poses=3, p50_ms=0.5)
    log.warning("warned", text='two "words"\nand a line')


def test_what_is_no_terminal_gets_one_json_object_a_line(capfd: pytest.CaptureFixture[str]) -> None:
    logged()
    first, second = (json.loads(line) for line in capfd.readouterr().err.splitlines())
    assert datetime.fromisoformat(first.pop("time")).utcoffset() is not None
    assert first == {"level": "info", "event": "ready", "folder": "/runs/1", "poses": 3, "p50_ms": 0.5}
    assert (second["level"], second["text"]) == ("warning", 'two "words"\nand a line')


def test_quiet_leaves_what_warns(capfd: pytest.CaptureFixture[str]) -> None:
    logged(quiet=True)
    (line,) = capfd.readouterr().err.splitlines()
    assert json.loads(line)["level"] == "warning"


def test_a_terminal_gets_words(monkeypatch: pytest.MonkeyPatch) -> None:
    ours, theirs = pty.openpty()
    with os.fdopen(theirs, "w") as terminal, os.fdopen(ours, "rb", buffering=0) as screen:
        monkeypatch.setattr("sys.stderr", terminal)
        logged()
        shown = b""
        while shown.count(b"\n") < 2:
            shown += screen.read(4096)
    first, second = shown.decode().splitlines()
    assert first.split()[1:] == ["info", "ready", "folder=/runs/1", "poses=3", "p50_ms=0.5"]
    assert second.endswith(r'warning warned text="two \"words\"\nand a line"')
