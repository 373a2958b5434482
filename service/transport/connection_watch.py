"""Logs when the daemon's connection is lost, refused or established, while Zenoh keeps trying to connect."""

import socket
import threading

import zenoh

from wayfi.recordings.closing import Closing
from wayfi.service.config import ZenohConfig
from wayfi.service.process.log_lines import LogLines
from wayfi.service.transport.zenoh_session import address_of, refused_at

PERIOD_S = 2.0
REFUSED_LOOKS = 3  # in a row: Zenoh itself tries again up to 2 s after an endpoint has come back


class ConnectionWatch(Closing):
    """Checks every `PERIOD_S` whether a session has a link to one of `config.connect`; a context manager.

    Each change is logged once; an endpoint refuses that answers and is not linked for `REFUSED_LOOKS`. Without
    endpoints in `config.connect` it does nothing.
    """

    def __init__(self, session: zenoh.Session, config: ZenohConfig, log: LogLines) -> None:
        self._session = session
        self._config = config
        self._log = log
        self._logged = ""
        self._refusals = 0  # in a row
        self._closed = threading.Event()
        self._thread = threading.Thread(target=self._watch, name="connection watch", daemon=True)
        if config.connect:
            self._thread.start()

    def close(self) -> None:
        """Stop checking."""
        self._closed.set()
        if self._thread.is_alive():
            self._thread.join()

    def _watch(self) -> None:
        while True:
            self._check()
            if self._closed.wait(PERIOD_S):
                return

    def _check(self) -> None:
        linked = self._linked()
        where = ", ".join(self._config.connect)
        refused = None if linked else refused_at(self._config)
        self._refusals = self._refusals + 1 if refused else 0
        text = f"connected to {linked}" if linked else refused or f"nobody answers at {where}"
        if text == self._logged or self._closed.is_set() or 0 < self._refusals < REFUSED_LOOKS:
            return
        self._logged = text
        if linked:
            self._log.info("connected", to=linked)
        else:
            self._log.warning("waiting", text=text)

    def _linked(self) -> str | None:
        """The first endpoint of `config.connect` that the session has a link to."""
        links = {str(link.dst).split("?")[0] for link in self._session.info.links()}
        return next((e for e in self._config.connect if links & _resolved(e)), None)


def _resolved(endpoint: str) -> set[str]:
    """The endpoint as Zenoh names its links: with each of the host's addresses in place of its name."""
    protocol, host, port = address_of(endpoint)
    try:
        found = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)
    except OSError:
        return set()
    addresses = {str(address[0]) for *_, address in found}
    return {f"{protocol}/[{a}]:{port}" if ":" in a else f"{protocol}/{a}:{port}" for a in addresses}
