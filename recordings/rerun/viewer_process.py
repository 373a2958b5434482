"""The Rerun viewer as a process of its own: it listens on 127.0.0.1 alone and reports nothing to anybody."""

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
    """The viewer cannot show this."""


@contextmanager
def viewer_process(
    arguments: list[str], environment: dict[str, str] | None = None
) -> Iterator[subprocess.Popen[bytes]]:
    """`rerun --bind 127.0.0.1 ARGUMENTS`, ended at the end of the block, with every process it started.

    `CI` set is how Rerun is told to keep its analytics off without writing to the user's configuration.
    """
    command = [sys.executable, "-m", "rerun", "--bind", HOST, *arguments]
    quiet = {"CI": "1", "RUST_LOG": os.environ.get("RUST_LOG", "error")}
    try:
        process = subprocess.Popen(command, env={**os.environ, **quiet, **(environment or {})}, start_new_session=True)
    except OSError as error:
        raise ViewerError(f"cannot start the Rerun viewer ({error}): install rerun-sdk beside wayfi") from error
    try:
        yield process
    finally:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGTERM)
        process.wait()


def free_port() -> int:
    """A TCP port of 127.0.0.1 that nobody listens on."""
    with socket.socket() as probe:
        probe.bind((HOST, 0))
        port: int = probe.getsockname()[1]
        return port
