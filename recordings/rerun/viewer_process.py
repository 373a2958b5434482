"""The Rerun viewer as a subprocess that listens on 127.0.0.1 only and sends no analytics."""

import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress

from wayfi.backend.errors import WayfiError

HOST = "127.0.0.1"


class ViewerError(WayfiError):
    """The viewer cannot start, or cannot show the log."""


@contextmanager
def viewer_process(
    arguments: list[str], environment: dict[str, str] | None = None
) -> Iterator[subprocess.Popen[bytes]]:
    """Run `rerun --bind 127.0.0.1 ARGUMENTS` during the block; then end it and its child processes.

    Raises ViewerError if it cannot start. `CI` in the environment turns Rerun's analytics off without a change of the
    user's configuration.
    """
    command = [sys.executable, "-m", "rerun", "--bind", HOST, *arguments]
    quiet = {"CI": "1", "RUST_LOG": os.environ.get("RUST_LOG", "error")}
    try:
        process = subprocess.Popen(command, env={**os.environ, **quiet, **(environment or {})}, start_new_session=True)
    except OSError as error:
        raise ViewerError(f"cannot start the Rerun viewer ({error}): is rerun-sdk installed?") from error
    try:
        yield process
    finally:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGTERM)
        process.wait()


def free_port() -> int:
    """A free TCP port of 127.0.0.1."""
    with socket.socket() as probe:
        probe.bind((HOST, 0))
        port: int = probe.getsockname()[1]
        return port
