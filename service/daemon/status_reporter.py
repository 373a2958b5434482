"""Publishes the daemon's status, and logs what is dropped."""

import time
from collections.abc import Mapping

from wayfi.service.daemon.diagnostics import Diagnostics
from wayfi.service.process.log_lines import LogLines
from wayfi.service.transport.publishers import Publishers


class StatusReporter:
    """Publishes the status of `diagnostics`; each topic and reason of drops is logged once."""

    def __init__(self, publishers: Publishers, diagnostics: Diagnostics, log: LogLines) -> None:
        self._publishers = publishers
        self._diagnostics = diagnostics
        self._log = log
        self._logged: set[tuple[str, str]] = set()

    def report(self, extra: Mapping[str, object]) -> None:
        """Publish the status as of now, with the values of `extra`."""
        self._publishers.publish_status(time.time_ns(), self._diagnostics.status(extra))
        dropped = {(topic, reason) for topic, reasons in self._diagnostics.dropped().items() for reason in reasons}
        for topic, reason in sorted(dropped - self._logged):
            self._log.warning("dropped", topic=topic, reason=reason, note="logged once; counted in wayfi/status")
        self._logged |= dropped
