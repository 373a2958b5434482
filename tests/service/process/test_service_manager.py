"""What the service manager is notified of, over real datagram sockets."""

import os
import secrets
import socket
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest
from live.clocks import Clock

from wayfi.service.process import service_manager
from wayfi.service.process.service_manager import ServiceManager


@pytest.fixture(autouse=True)
def environment(monkeypatch: pytest.MonkeyPatch) -> None:
    """An environment without a service manager."""
    for name in ("NOTIFY_SOCKET", "WATCHDOG_USEC", "WATCHDOG_PID"):
        monkeypatch.delenv(name, raising=False)


@pytest.fixture(params=["file", "abstract"])
def manager(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[socket.socket]:
    """The socket of a manager that the environment names."""
    name = f"@wayfi-{secrets.token_hex(8)}" if request.param == "abstract" else str(tmp_path / "notify")
    monkeypatch.setenv("NOTIFY_SOCKET", name)
    with closing(socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)) as listener:
        listener.bind("\0" + name[1:] if name.startswith("@") else name)
        listener.settimeout(5.0)
        yield listener


def waiting(listener: socket.socket) -> list[str]:
    """What has been received by now."""
    listener.setblocking(False)
    received = []
    while True:
        try:
            received.append(listener.recv(4096).decode())
        except BlockingIOError:
            return received


def test_it_is_notified_in_its_own_words(manager: socket.socket) -> None:
    service = ServiceManager()
    service.ready("waits for /odom")
    service.stopping()
    assert waiting(manager) == ["READY=1\nSTATUS=waits for /odom", "STOPPING=1"]


def test_a_status_stays_one_line(manager: socket.socket) -> None:
    ServiceManager().ready("one\nSTOPPING=1")
    assert waiting(manager) == ["READY=1\nSTATUS=one STOPPING=1"]


def test_it_is_notified_three_times_in_the_watchdogs_time(
    manager: socket.socket, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("WATCHDOG_USEC", "300000")
    monkeypatch.setenv("WATCHDOG_PID", str(os.getpid()))
    clock = Clock()
    monkeypatch.setattr(service_manager, "time", clock)
    service = ServiceManager()
    service.alive()
    service.alive()
    assert waiting(manager) == ["WATCHDOG=1"]
    clock.sleep(0.11)
    service.alive()
    assert waiting(manager) == ["WATCHDOG=1"]


@pytest.mark.parametrize("watchdog", [{}, {"WATCHDOG_USEC": "300000", "WATCHDOG_PID": "1"}, {"WATCHDOG_USEC": "x"}])
def test_without_a_watchdog_for_this_process_alive_sends_nothing(
    watchdog: dict[str, str], manager: socket.socket, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, value in watchdog.items():
        monkeypatch.setenv(name, value)
    ServiceManager().alive()
    assert waiting(manager) == []


def test_without_a_manager_nothing_is_sent(manager: socket.socket, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("NOTIFY_SOCKET")
    service = ServiceManager()
    service.ready("")
    service.alive()
    service.stopping()
    assert waiting(manager) == []


def test_a_manager_that_was_away_is_notified_once_it_is_back(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = str(tmp_path / "notify")
    monkeypatch.setenv("NOTIFY_SOCKET", path)
    monkeypatch.setenv("WATCHDOG_USEC", "3")
    service = ServiceManager()
    service.ready("")
    service.alive()
    with closing(socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)) as listener:
        listener.bind(path)
        service.stopping()
        assert waiting(listener) == ["STOPPING=1"]


def test_a_manager_that_reads_nothing_delays_nobody_and_is_notified_once_it_reads(manager: socket.socket) -> None:
    service = ServiceManager()
    sent = 2000
    for _ in range(sent):
        service.ready("x" * 1000)
    assert 0 < len(waiting(manager)) < sent
    service.stopping()
    assert waiting(manager) == ["STOPPING=1"]
