"""What is logged of a connection: changes, once each, and no refusal that is none."""

from typing import cast

import pytest
import zenoh
from live.loopback import eventually

from wayfi.service.config import ZenohConfig
from wayfi.service.process.log_lines import LogLines
from wayfi.service.transport import connection_watch
from wayfi.service.transport.connection_watch import REFUSED_LOOKS, ConnectionWatch

REFUSED = "tcp/127.0.0.1:1 answers and refuses us"
CONFIG = ZenohConfig(connect=["tcp/127.0.0.1:1"])


class Lines(LogLines):
    """Keeps the lines."""

    def __init__(self) -> None:
        super().__init__()
        self.told: list[str] = []

    def info(self, event: str, **fields: object) -> None:
        self.told.append(f"{event} {fields['to']}")

    def warning(self, event: str, **fields: object) -> None:
        self.told.append(f"{event} {fields['text']}")


def told_of(looks: str, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """What is logged where each look finds a link (l), an answer without one (a) or nobody (n)."""
    left, log = list(looks), Lines()

    def linked(_: ConnectionWatch) -> str | None:
        return CONFIG.connect[0] if left and left[0] == "l" else None

    def refused(_: ZenohConfig) -> str | None:
        return REFUSED if left and left[0] == "a" else None

    def looked(watch: ConnectionWatch) -> None:
        if left:
            look(watch)
            left.pop(0)

    look = ConnectionWatch._check
    monkeypatch.setattr(connection_watch, "PERIOD_S", 0.001)
    monkeypatch.setattr(connection_watch, "refused_at", refused)
    monkeypatch.setattr(ConnectionWatch, "_linked", linked)
    monkeypatch.setattr(ConnectionWatch, "_check", looked)
    with ConnectionWatch(cast(zenoh.Session, None), CONFIG, log):
        eventually(lambda: not left)
    return [line.split()[0] + (" refused" if "refuses" in line else "") for line in log.told]


def test_an_endpoint_that_has_come_back_and_is_not_linked_yet_refuses_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    assert told_of("lnn" + "a" * (REFUSED_LOOKS - 1) + "ll", monkeypatch) == ["connected", "waiting", "connected"]


def test_one_that_answers_and_never_links_refuses(monkeypatch: pytest.MonkeyPatch) -> None:
    assert told_of("n" + "a" * (REFUSED_LOOKS + 2), monkeypatch) == ["waiting", "waiting refused"]


def test_looks_are_counted_in_a_row(monkeypatch: pytest.MonkeyPatch) -> None:
    assert told_of("lan" * (REFUSED_LOOKS + 1), monkeypatch) == ["connected", "waiting"] * (REFUSED_LOOKS + 1)
