"""Sessions: connecting, the size of messages, where they listen, wrong settings and keys."""

from pathlib import Path
from typing import Any

import psutil
import pytest
import zenoh
from live.loopback import daemon_process, endpoint, eventually, free_port, logged

from wayfi.service.config import ZenohConfig
from wayfi.service.transport.zenoh_session import (
    MAX_MESSAGE_BYTES,
    RefusedError,
    UnreachableError,
    ZenohError,
    key_of,
    open_guest_session,
    open_session,
)


def test_nobody_there_is_no_refusal() -> None:
    with pytest.raises(UnreachableError) as nobody:
        open_guest_session(ZenohConfig(connect=[endpoint()]))
    assert not isinstance(nobody.value, RefusedError)


def test_a_peer_that_starts_before_its_router_finds_it() -> None:
    router = ZenohConfig(mode="router", listen=[endpoint()])
    with open_session(ZenohConfig(listen=[], connect=router.listen)) as peer, open_session(router) as session:
        eventually(lambda: list(peer.info.routers_zid()))
        assert list(peer.info.routers_zid()) == [session.info.zid()]


def test_a_message_that_is_too_large_is_dropped_and_the_next_is_received() -> None:
    config = ZenohConfig(listen=[endpoint()])
    received: list[int] = []
    with (
        open_session(config) as session,
        session.declare_subscriber("points", lambda sample: received.append(len(sample.payload))),
        open_guest_session(config) as guest,
        guest.declare_publisher("points", congestion_control=zenoh.CongestionControl.BLOCK) as publisher,
    ):
        for size in (MAX_MESSAGE_BYTES // 2, MAX_MESSAGE_BYTES + 1, 7):
            publisher.put(bytes(size))
        eventually(lambda: 7 in received)
    assert received == [MAX_MESSAGE_BYTES // 2, 7]


def test_nothing_listens_beyond_loopback_unless_told_to(tmp_path: Path) -> None:
    config = ZenohConfig(listen=[endpoint()])
    with daemon_process(config, tmp_path) as (process, log):
        eventually(lambda: logged(log, "ready"))
        whole = [psutil.Process(process.pid), *psutil.Process(process.pid).children(recursive=True)]
        found = [c for p in whole for c in p.net_connections("inet") if c.status in (psutil.CONN_LISTEN, "NONE")]
    assert {f"tcp/{c.laddr.ip}:{c.laddr.port}" for c in found} >= {config.listen[0]}
    assert {c.laddr.ip for c in found} == {"127.0.0.1"}


@pytest.mark.parametrize("change", [{"mode": "star"}, {"listen": ["nonsense"]}, {"listen": ["tcp/127.0.0.1:99999"]}])
def test_a_setting_that_zenoh_refuses_is_one_line(change: dict[str, Any]) -> None:
    with pytest.raises(ZenohError) as caught:
        open_session(ZenohConfig(**change))
    assert "\n" not in str(caught.value)
    assert ".rs:" not in str(caught.value)


def test_a_prefix_that_makes_no_key_is_one_line() -> None:
    with pytest.raises(ZenohError, match=r"zenoh\.prefix"):
        key_of(ZenohConfig(prefix="a//b"), "odom")


def test_clients_that_come_and_go_leave_no_memory_behind() -> None:
    config = ZenohConfig(listen=[f"tcp/127.0.0.1:{free_port()}"])
    with open_session(config):
        before = Path("/proc/self/maps").read_text().count("/dev/shm/")
        for _ in range(3):
            with open_guest_session(config) as guest:
                for _ in range(200):
                    guest.put("x", bytes(100_000), congestion_control=zenoh.CongestionControl.BLOCK)
        assert Path("/proc/self/maps").read_text().count("/dev/shm/") == before
