"""Notifies the service manager (systemd): ready, alive, stopping. After Linux's sd_notify(3)."""

import os
import socket
import time
from contextlib import suppress


class ServiceManager:
    """Sends datagrams to the socket that the environment names in NOTIFY_SOCKET; without one, does nothing.

    What cannot be sent is lost.
    """

    def __init__(self) -> None:
        address = os.environ.get("NOTIFY_SOCKET", "")
        self._address = "\0" + address[1:] if address.startswith("@") else address
        self._period_s = _watchdog_s() / 3
        self._alive_s = float("-inf")

    def ready(self, status: str) -> None:
        """Notify that the daemon is ready; `status` is one line for a person."""
        self._send(f"READY=1\nSTATUS={_line(status)}")

    def alive(self) -> None:
        """Notify that the main loop runs, at most three times in the watchdog's time; to be called in each step."""
        now_s = time.monotonic()
        if self._period_s and now_s - self._alive_s >= self._period_s:
            self._alive_s = now_s
            self._send("WATCHDOG=1")

    def stopping(self) -> None:
        """Notify that the daemon is stopping."""
        self._send("STOPPING=1")

    def _send(self, text: str) -> None:
        if self._address:
            with suppress(OSError), socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK) as sender:
                sender.sendto(text.encode(), self._address)


def _line(text: str) -> str:
    return " ".join(text.splitlines())


def _watchdog_s() -> float:
    """The watchdog's time for this process, s; 0 without a watchdog."""
    meant_for = os.environ.get("WATCHDOG_PID", str(os.getpid()))
    microseconds = os.environ.get("WATCHDOG_USEC", "")
    return int(microseconds) * 1e-6 if microseconds.isdigit() and meant_for == str(os.getpid()) else 0.0
