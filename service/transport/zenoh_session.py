"""Sessions on Zenoh: without multicast scouting, and listening only where the configuration says."""

import json
import socket
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import zenoh

from wayfi.backend.errors import WayfiError
from wayfi.service.config import SecurityConfig, ZenohConfig
from wayfi.service.transport.zenoh_security import credentials, security_settings

RETRY_S = 0.2
RETRY = {"period_init_ms": 200, "period_max_ms": 2000, "period_increase_factor": 2}
PROBE_S = 1.0
MAX_MESSAGE_BYTES = 64 << 20  # twice the largest cloud; Zenoh's default is 1 GiB, of memory, for each connection
WAIT_BEFORE_CLOSE_US = 60_000_000  # of a reliable put to a busy daemon; Zenoh's default of 5 s would cut it off


class ZenohError(WayfiError):
    """A session that cannot be opened, or an invalid key."""


class UnreachableError(ZenohError):
    """Nobody answers at the endpoints to connect to; a later attempt may succeed."""


class RefusedError(UnreachableError):
    """Somebody answers there and refuses the connection, because of passwords or certificates."""


def open_session(config: ZenohConfig) -> zenoh.Session:
    """The daemon's session. A peer or router starts without a connection and keeps trying to connect.

    Raises ZenohError and SecurityError; UnreachableError where a client finds no router.
    """
    listen = config.listen if config.mode != "client" else []
    return _open(config.mode, listen, config.connect, config.security)


def open_guest_session(config: ZenohConfig) -> zenoh.Session:
    """A client of `config.connect`, or else of the daemon at the endpoints where it listens.

    It is a client because the daemon, a peer, routes between a client and others, but not between two peers. Raises
    ZenohError and SecurityError; UnreachableError where nobody answers.
    """
    return _open("client", [], config.connect or config.listen, config.security)


def open_with_retries(
    open_once: Callable[[], zenoh.Session], keep_trying: Callable[[UnreachableError], bool]
) -> zenoh.Session:
    """What `open_once` opens; called again while nobody answers and `keep_trying` is true. Raises ZenohError."""
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


def address_of(endpoint: str) -> tuple[str, str, int]:
    """Protocol, host and port of `protocol/host:port`; port 0 where there is none."""
    protocol, _, address = endpoint.split("?")[0].split("#")[0].partition("/")
    host, _, port = address.rpartition(":")
    return protocol, host.strip("[]"), int(port) if port.isdigit() else 0


def refused_at(config: ZenohConfig) -> str | None:
    """Which endpoint of `config.connect` answers and what it was shown, as text; None where none answers."""
    return _refused_at(config.connect, config.security)


def _open(mode: str, listen: Sequence[str], connect: Sequence[str], security: SecurityConfig) -> zenoh.Session:
    if mode not in ("peer", "client", "router"):
        raise ZenohError(f"zenoh.mode: {mode!r} is not one of peer, client, router")
    settings = _settings(mode, listen, connect) | security_settings(security, admits=mode != "client")
    try:
        return _open_with(settings)
    except zenoh.ZError as error:
        where = f"{mode}, listen {', '.join(listen) or 'nowhere'}, connect {', '.join(connect) or 'to nobody'}"
        translated = _translated(str(error), where)
    refused = _refused_at(connect, security) if isinstance(translated, UnreachableError) else None
    if refused is None:
        raise translated
    try:
        return _open_with(settings)  # the listener may have started only now
    except zenoh.ZError:
        raise RefusedError(f"Zenoh: {refused}") from None


def _settings(mode: str, listen: Sequence[str], connect: Sequence[str]) -> dict[str, Any]:
    patience = {} if mode == "client" else {"timeout_ms": -1, "exit_on_failure": False}  # without end, after open()
    return {
        "mode": mode,
        "listen": {"endpoints": list(listen)},
        "connect": {"endpoints": list(connect), "retry": RETRY, **patience},
        "scouting": {"multicast": {"enabled": False}},
        "transport/shared_memory/enabled": False,  # 16 MB of each client would stay mapped after it has left
        "timestamping": {"enabled": True},  # latched messages are ordered by it
        "transport/link/rx/max_message_size": MAX_MESSAGE_BYTES,
        "transport/link/tx/queue/congestion_control/block/wait_before_close": WAIT_BEFORE_CLOSE_US,
    }


def _open_with(settings: Mapping[str, Any]) -> zenoh.Session:
    made = zenoh.Config()
    for key, value in settings.items():
        made.insert_json5(key, json.dumps(value))
    return zenoh.open(made)


def _translated(text: str, where: str) -> ZenohError:
    """Zenoh's error in one line, without the positions in its sources."""
    text = " ".join(text.split(" at /")[0].split())
    if "already in use" in text:
        return ZenohError(f"Zenoh ({where}): the port is in use, perhaps by another `wayfi run`; see zenoh.listen")
    if "Unable to connect" in text:
        return UnreachableError(f"Zenoh ({where}): nobody answers there; see zenoh.connect")
    return ZenohError(f"Zenoh ({where}): {text}")


def _refused_at(endpoints: Sequence[str], security: SecurityConfig) -> str | None:
    for endpoint in endpoints:
        if _answers(endpoint):
            return f"{endpoint} answers and refuses us: we show {credentials(security, endpoint)}"
    return None


def _answers(endpoint: str) -> bool:
    """Whether a TCP connection to `endpoint` is accepted."""
    protocol, host, port = address_of(endpoint)
    if protocol not in ("tcp", "tls"):
        return False
    try:
        with socket.create_connection((host, port), PROBE_S):
            return True
    except (OSError, OverflowError):
        return False
