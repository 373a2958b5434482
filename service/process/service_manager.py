"""Word to the service manager (systemd's sd_notify): ready, still alive, stopping."""

import os
import socket
import time
from collections.abc import Mapping
from contextlib import suppress


class ServiceManager:
    """Sends datagrams to the socket that `environment` names in NOTIFY_SOCKET; without one, does nothing.

    A manager that is away is no reason to stop: what cannot be sent is lost. After Linux's sd_notify(3).
    """

    def __init__(self, environment: Mapping[str, str] = os.environ) -> None:
        address = environment.get("NOTIFY_SOCKET", "")
        self._address = "\0" + address[1:] if address.startswith("@") else address
        self._period_s = _watchdog_s(environment) / 3
        self._alive_s = float("-inf")

    def ready(self, status: str) -> None:
        """All is up; `status` is one line for a person."""
        self._send(f"READY=1\nSTATUS={_line(status)}")

    def status(self, text: str) -> None:
        """One line for a person."""
        self._send(f"STATUS={_line(text)}")

    def alive(self) -> None:
        """The main loop turns; to be called at each turn, it sends a third of the watchdog's time apart."""
        now_s = time.monotonic()
        if self._period_s and now_s - self._alive_s >= self._period_s:
            self._alive_s = now_s
            self._send("WATCHDOG=1")

    def stopping(self) -> None:
        """The end has begun."""
        self._send("STOPPING=1")

    def _send(self, text: str) -> None:
        if self._address:
            with suppress(OSError), socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK) as sender:
                sender.sendto(text.encode(), self._address)


def _line(text: str) -> str:
    return " ".join(text.splitlines())


def _watchdog_s(environment: Mapping[str, str]) -> float:
    """How long the manager waits for a sign of life from this process, s; 0 where it does not."""
    meant_for = environment.get("WATCHDOG_PID", str(os.getpid()))
    microseconds = environment.get("WATCHDOG_USEC", "")
    return int(microseconds) * 1e-6 if microseconds.isdigit() and meant_for == str(os.getpid()) else 0.0
