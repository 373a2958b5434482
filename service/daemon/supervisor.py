"""Keeps the estimation of a run going: one that ends unexpectedly is started again."""

from collections.abc import Callable
from dataclasses import replace

from wayfi.recordings.closing import Closing
from wayfi.service.blackbox.recorder import Recorder
from wayfi.service.daemon.estimator_messages import Backlog, Ready, Report, Start
from wayfi.service.daemon.estimator_process import EstimatorProcess

MOST_DEATHS = 2  # in a row, none of which came as far as being ready


class Supervisor(Closing):
    """Starts an estimation, and another where it ends; a context manager, which ends the last."""

    def __init__(self, start: Start, backlog: Backlog, recorder: Recorder, wake: Callable[[], None]) -> None:
        self._start = start
        self._backlog = backlog
        self._recorder = recorder
        self._wake = wake
        self._deaths = 0
        self._estimation = self._started(start)

    @property
    def ended(self) -> bool:
        """Whether the estimation has ended by itself."""
        return self._estimation.ended

    def reports(self) -> list[Report]:
        """What the estimation has reported since the last call."""
        return self._estimation.reports()

    def feed(self, ready: Ready) -> None:
        """Feed the estimation from now on, after it reported `ready`."""
        self._deaths = 0
        self._estimation.feed(ready)

    def restart(self) -> bool:
        """Start another after one that ended: from its last checkpoint and what the black box holds since.

        False, and nothing is started, after more than `MOST_DEATHS` in a row.
        """
        self._estimation.close()
        self._deaths += 1
        if self._deaths > MOST_DEATHS:
            return False
        self._recorder.flush()
        self._estimation = self._started(replace(self._start, resumes=True))
        return True

    def close(self) -> None:
        """End the estimation."""
        self._estimation.close()

    def _started(self, start: Start) -> EstimatorProcess:
        return EstimatorProcess(start, self._backlog, self._recorder, self._wake)
