"""The table of a run's states: whole, no dead ends but the ends, and held to."""

from itertools import product

import pytest

from wayfi.service.daemon.daemon_state import TRANSITIONS, DaemonState, IllegalTransitionError, StateMachine

ENDS = {DaemonState.STOPPED, DaemonState.ABANDONED}
BEGINNINGS = {False: DaemonState.STARTING, True: DaemonState.RECOVERING}  # by whether a drive is resumed


def way(start: DaemonState, end: DaemonState) -> list[DaemonState]:
    """The states of a shortest way from `start` to `end` by the table, both included; empty where there is none."""
    ways, seen = [[start]], {start}
    for states in ways:
        if states[-1] is end:
            return states
        following = TRANSITIONS[states[-1]] - seen
        seen |= following
        ways += [[*states, state] for state in following]
    return []


def machine_in(state: DaemonState) -> StateMachine:
    resumes, states = next((r, w) for r, start in BEGINNINGS.items() if (w := way(start, state)))
    machine = StateMachine(resumes)
    for following in states[1:]:
        machine.change(following)
    assert machine.state is state
    return machine


def test_the_table_has_every_state() -> None:
    assert set(TRANSITIONS) == set(DaemonState)


@pytest.mark.parametrize("resumes", [False, True])
def test_a_run_starts_or_recovers(resumes: bool) -> None:
    assert StateMachine(resumes).state is BEGINNINGS[resumes]


@pytest.mark.parametrize("state", DaemonState)
def test_every_state_is_reachable(state: DaemonState) -> None:
    assert any(way(start, state) for start in BEGINNINGS.values())


@pytest.mark.parametrize("state", DaemonState)
def test_an_end_is_reachable_from_every_state_and_ends_are_ends(state: DaemonState) -> None:
    assert any(way(state, end) for end in ENDS)
    assert (not TRANSITIONS[state]) == (state in ENDS)


def test_what_is_asked_to_end_serves_no_more() -> None:
    assert not any(
        after.serving for before, following in TRANSITIONS.items() for after in following if not before.serving
    )


@pytest.mark.parametrize("state", DaemonState)
def test_a_requested_end_drains_what_runs_and_changes_nothing_twice(state: DaemonState) -> None:
    machine = machine_in(state)
    machine.request_end()
    running, waiting = state is DaemonState.RUNNING, state in BEGINNINGS.values()
    assert machine.state is (DaemonState.DRAINING if running else DaemonState.FINISHING if waiting else state)
    ended = machine.state
    machine.request_end()
    assert machine.state is ended


@pytest.mark.parametrize(("before", "after"), list(product(DaemonState, DaemonState)))
def test_only_what_the_table_has_is_done(before: DaemonState, after: DaemonState) -> None:
    machine = machine_in(before)
    if after in TRANSITIONS[before]:
        machine.change(after)
        assert machine.state is after
    else:
        with pytest.raises(IllegalTransitionError, match=f"{before} -> {after}"):
            machine.change(after)
        assert machine.state is before
