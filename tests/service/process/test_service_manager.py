"""What the service manager is notified of, over real datagram sockets."""

import os
import secrets
import socket
import time
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from wayfi.service.process.service_manager import ServiceManager

Manager = tuple[socket.socket, dict[str, str]]


@pytest.fixture(params=["file", "abstract"])
def manager(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Manager]:
    """A manager's socket, and the environment that it gives."""
    name = f"@wayfi-{secrets.token_hex(8)}" if request.param == "abstract" else str(tmp_path / "notify")
    with closing(socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)) as listener:
        listener.bind("\0" + name[1:] if name.startswith("@") else name)
        listener.settimeout(5.0)
        yield listener, {"NOTIFY_SOCKET": name}


def waiting(listener: socket.socket) -> list[str]:
    """What has been received by now."""
    listener.setblocking(False)
    received = []
    while True:
        try:
            received.append(listener.recv(4096).decode())
        except BlockingIOError:
            return received


def test_it_is_notified_in_its_own_words(manager: Manager) -> None:
    listener, environment = manager
    service = ServiceManager(environment)
    service.ready("waits for /odom")
    service.stopping()
    assert waiting(listener) == ["READY=1\nSTATUS=waits for /odom", "STOPPING=1"]


def test_a_status_stays_one_line(manager: Manager) -> None:
    listener, environment = manager
    ServiceManager(environment).ready("one\nSTOPPING=1")
    assert waiting(listener) == ["READY=1\nSTATUS=one STOPPING=1"]


def test_it_is_notified_three_times_in_the_watchdogs_time(manager: Manager) -> None:
    listener, environment = manager
    service = ServiceManager(environment | {"WATCHDOG_USEC": "300000", "WATCHDOG_PID": str(os.getpid())})
    service.alive()
    service.alive()
    assert waiting(listener) == ["WATCHDOG=1"]
    time.sleep(0.11)
    service.alive()
    assert waiting(listener) == ["WATCHDOG=1"]


@pytest.mark.parametrize("watchdog", [{}, {"WATCHDOG_USEC": "300000", "WATCHDOG_PID": "1"}, {"WATCHDOG_USEC": "x"}])
def test_without_a_watchdog_for_this_process_alive_sends_nothing(watchdog: dict[str, str], manager: Manager) -> None:
    listener, environment = manager
    ServiceManager(environment | watchdog).alive()
    assert waiting(listener) == []


def test_without_a_manager_nothing_is_sent(manager: Manager) -> None:
    listener, _ = manager
    service = ServiceManager({})
    service.ready("")
    service.alive()
    service.stopping()
    assert waiting(listener) == []


def test_a_manager_that_was_away_is_notified_once_it_is_back(tmp_path: Path) -> None:
    path = str(tmp_path / "notify")
    service = ServiceManager({"NOTIFY_SOCKET": path, "WATCHDOG_USEC": "3"})
    service.ready("")
    service.alive()
    with closing(socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)) as listener:
        listener.bind(path)
        service.stopping()
        assert waiting(listener) == ["STOPPING=1"]


def test_a_manager_that_reads_nothing_delays_nobody_and_is_notified_once_it_reads(manager: Manager) -> None:
    listener, environment = manager
    service = ServiceManager(environment)
    sent = 2000
    for _ in range(sent):
        service.ready("x" * 1000)
    assert 0 < len(waiting(listener)) < sent
    service.stopping()
    assert waiting(listener) == ["STOPPING=1"]
