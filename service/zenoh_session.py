"""Sessions on Zenoh: nothing is found by multicast, and nothing listens beyond what the configuration says."""

import json
import time
from collections.abc import Callable, Sequence
from typing import Any

import zenoh

from wayfi.backend.errors import WayfiError
from wayfi.service.config import ZenohConfig

RETRY_S = 0.2
RETRY = {"period_init_ms": 200, "period_max_ms": 2000, "period_increase_factor": 2}
WAIT_BEFORE_CLOSE_US = 60_000_000  # of a reliable put to a daemon that is busy; Zenoh's own 5 s would cut it off


class ZenohError(WayfiError):
    """A session that cannot be opened, or a key that Zenoh does not take."""


class UnreachableError(ZenohError):
    """Nobody answers at the endpoints to connect to: it may work later."""


def open_session(config: ZenohConfig) -> zenoh.Session:
    """The daemon's session. Raises ZenohError; UnreachableError where a client finds no router.

    A peer or router starts alone, and goes on trying to connect.
    """
    return _open(config.mode, config.listen if config.mode != "client" else [], config.connect)


def open_guest_session(config: ZenohConfig) -> zenoh.Session:
    """A client of `config.connect`, or else of the daemon at the endpoints where it listens.

    A client, because a peer such as the daemon passes on between a client and others, but not between two peers.
    Raises ZenohError; UnreachableError where nobody answers.
    """
    return _open("client", [], config.connect or config.listen)


def patiently(open_once: Callable[[], zenoh.Session], keep_trying: Callable[[UnreachableError], bool]) -> zenoh.Session:
    """What `open_once` opens; asked again while nobody answers and `keep_trying`. Raises ZenohError."""
    while True:
        try:
            return open_once()
        except UnreachableError as error:
            if not keep_trying(error):
                raise
            time.sleep(RETRY_S)


def key_of(config: ZenohConfig, name: str) -> str:
    """The key of a topic or of one of wayfi's own names: `<prefix>/name`, no slash at either end. Raises ZenohError."""
    key = "/".join(part for part in (config.prefix.strip("/"), name.strip("/")) if part)
    try:
        return str(zenoh.KeyExpr(key))
    except zenoh.ZError:
        raise ZenohError(f"{key!r} is no key for Zenoh: change zenoh.prefix, or the topic in recording") from None


def _open(mode: str, listen: Sequence[str], connect: Sequence[str]) -> zenoh.Session:
    if mode not in ("peer", "client", "router"):
        raise ZenohError(f"zenoh.mode: {mode!r} is not one of peer, client, router")
    settings: dict[str, Any] = {
        "mode": mode,
        "listen": {"endpoints": list(listen)},
        "connect": {"endpoints": list(connect), "retry": RETRY},
        "scouting": {"multicast": {"enabled": False}},
        "timestamping": {"enabled": True},  # what is kept for late joiners is ordered by it
        "transport/link/tx/queue/congestion_control/block/wait_before_close": WAIT_BEFORE_CLOSE_US,
    }
    if mode != "client":
        settings["connect"] |= {"timeout_ms": 0, "exit_on_failure": False}
    try:
        made = zenoh.Config()
        for key, value in settings.items():
            made.insert_json5(key, json.dumps(value))
        return zenoh.open(made)
    except zenoh.ZError as error:
        raise _explained(str(error), mode, listen, connect) from None


def _explained(text: str, mode: str, listen: Sequence[str], connect: Sequence[str]) -> ZenohError:
    """What is wrong, in one line, without the places in Zenoh's own sources."""
    where = f"{mode}, listen {', '.join(listen) or 'nowhere'}, connect {', '.join(connect) or 'to nobody'}"
    text = " ".join(text.split(" at /")[0].split())
    if "already in use" in text:
        return ZenohError(f"Zenoh ({where}): the port is in use, perhaps by another `wayfi run`; see zenoh.listen")
    if "Unable to connect" in text:
        return UnreachableError(f"Zenoh ({where}): nobody answers there; see zenoh.connect")
    return ZenohError(f"Zenoh ({where}): {text}")
