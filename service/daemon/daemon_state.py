"""The states of a daemon's run, and the table of which may follow which."""

from collections.abc import Mapping
from enum import StrEnum


class IllegalTransitionError(RuntimeError):
    """A change of state that the table does not have: a fault in the daemon."""


class DaemonState(StrEnum):
    """What a run does with what it receives. A new run is STARTING at first, a resumed one RECOVERING."""

    STARTING = "starting"  # nothing is received until the estimation is ready
    RECOVERING = "recovering"  # messages wait until the estimate of the drive so far is known
    RUNNING = "running"  # poses are published and messages fed
    DRAINING = "draining"  # the end was requested: nothing more is received, what waits is published and fed
    FINISHING = "finishing"  # no pose is published any more; what the backlog holds is fed, the results are written
    STOPPED = "stopped"  # the results are written
    ABANDONED = "abandoned"  # the estimation ends each time on this drive: there are no results

    @property
    def serving(self) -> bool:
        """Whether no end has been requested or reached."""
        return self in (DaemonState.STARTING, DaemonState.RECOVERING, DaemonState.RUNNING)


TRANSITIONS: Mapping[DaemonState, frozenset[DaemonState]] = {
    DaemonState.STARTING: frozenset({DaemonState.RUNNING, DaemonState.FINISHING}),
    DaemonState.RECOVERING: frozenset({DaemonState.RUNNING, DaemonState.FINISHING, DaemonState.ABANDONED}),
    DaemonState.RUNNING: frozenset({DaemonState.RECOVERING, DaemonState.DRAINING, DaemonState.ABANDONED}),
    DaemonState.DRAINING: frozenset({DaemonState.FINISHING}),
    DaemonState.FINISHING: frozenset({DaemonState.STOPPED}),
    DaemonState.STOPPED: frozenset(),
    DaemonState.ABANDONED: frozenset(),
}


class StateMachine:
    """The state of one run."""

    def __init__(self, resumes: bool) -> None:
        self._state = DaemonState.RECOVERING if resumes else DaemonState.STARTING

    @property
    def state(self) -> DaemonState:
        """The present state."""
        return self._state

    def request_end(self) -> None:
        """Begin the end of a run that serves; does nothing where the end has begun.

        Only a run that is RUNNING is drained: before that no pose of the messages that wait could be published.
        """
        if self._state.serving:
            self.change(DaemonState.DRAINING if self._state is DaemonState.RUNNING else DaemonState.FINISHING)

    def change(self, to: DaemonState) -> None:
        """Change the state. Raises IllegalTransitionError where the table does not have it."""
        if to not in TRANSITIONS[self._state]:
            raise IllegalTransitionError(f"{self._state} -> {to}")
        self._state = to
