"""The command line in this process, for the tests of its commands."""

import ctypes
import json
from pathlib import Path
from typing import Any

from drives import Replayed
from typer.testing import CliRunner, Result

from wayfi.service.cli.app import app

PR_CAPBSET_DROP, CAP_DAC_OVERRIDE = 24, 1


def obey_permissions() -> None:
    """Called in a new process: root may write what nobody may; without this capability it may not."""
    ctypes.CDLL(None).prctl(PR_CAPBSET_DROP, CAP_DAC_OVERRIDE, 0, 0, 0)


def wayfi(*arguments: str | Path) -> Result:
    """`wayfi` with these arguments, in this process."""
    return CliRunner().invoke(app, [str(a) for a in arguments], terminal_width=200)


def one_object(done: Result) -> dict[str, Any]:
    """The one JSON object that stdout is."""
    assert done.exit_code == 0, done.output
    assert done.stdout.count("\n") == 1
    value = json.loads(done.stdout)
    assert isinstance(value, dict)
    return value


def copied_replay(replayed: Replayed, to: Path) -> Path:
    """What `evaluate` reads of a replay, in a folder of its own in `to`."""
    folder = to / "copy"
    folder.mkdir()
    for name in ("trajectory.tum", "online.tum", "closures.csv"):
        (folder / name).write_bytes((replayed.out / name).read_bytes())
    return folder
