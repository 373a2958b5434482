"""The text log: every verdict with its reason, state changes, warnings and drops."""

from collections import Counter

import numpy as np
import rerun as rr

from wayfi.backend.graph.health import State
from wayfi.frontends.events import ClosureJudged, Dropped, DropReason, StateChanged, Verdict, Warned
from wayfi.frontends.measurements import Sensor
from wayfi.recordings.rerun.stream import RerunStream
from wayfi.recordings.rerun.style import STATE, VERDICT, Color
from wayfi.recordings.rerun.views.view import Handlers

REFUSED_TEXT: Color = (225, 130, 85)
WARNING: Color = (255, 165, 40)


class TextView:
    """Writes `/log/verdicts`, `/log/state`, `/log/warnings` and `/log/drops`."""

    def __init__(self, stream: RerunStream) -> None:
        self._stream = stream
        self._drops: Counter[tuple[Sensor, DropReason]] = Counter()

    def handlers(self) -> Handlers:
        """The method that draws each kind of event."""
        return {
            ClosureJudged: self.on_closure,
            StateChanged: self.on_state,
            Warned: self.on_warning,
            Dropped: self.on_drop,
        }

    def on_closure(self, event: ClosureJudged) -> None:
        """Write the verdict on a candidate and its reason."""
        color = REFUSED_TEXT if event.verdict is Verdict.REFUSED else VERDICT[event.verdict]
        level = "WARN" if event.verdict is Verdict.REMOVED else "INFO"
        self._line("verdicts", _verdict(event), level, color)

    def on_state(self, event: StateChanged) -> None:
        """Write a change of state and its reason."""
        level = "INFO" if event.state is State.TRACKING else "WARN"
        self._line("state", f"{event.state.value}: {event.reason}", level, STATE[event.state])

    def on_warning(self, event: Warned) -> None:
        """Write a warning, with the text of the report."""
        self._line("warnings", event.text, "WARN", WARNING)

    def on_drop(self, event: Dropped) -> None:
        """Write the 1st, 10th, 100th, ... drop of its kind, so that a broken sensor does not fill the log."""
        kind = (event.sensor, event.reason)
        self._drops[kind] += 1
        if _is_power_of_ten(self._drops[kind]):
            self._line("drops", self._drop(kind), "DEBUG", None)

    def log_totals(self) -> None:
        """Write the final number of drops of each kind."""
        for kind, count in self._drops.items():
            if not _is_power_of_ten(count):
                self._line("drops", self._drop(kind), "DEBUG", None)

    def _drop(self, kind: tuple[Sensor, DropReason]) -> str:
        return f"dropped {kind[0].value}: {kind[1].value} ({self._drops[kind]} so far)"

    def _line(self, name: str, text: str, level: str, color: Color | None) -> None:
        self._stream.log(f"/log/{name}", rr.TextLog(text, level=level, color=color))


def _verdict(event: ClosureJudged) -> str:
    figures = (
        ("similarity", event.similarity, ""),
        ("residual", event.residual_m, " m"),
        ("inlier ratio", event.inlier_ratio, ""),
    )
    known = ", ".join(f"{name} {value:.2f}{unit}" for name, value, unit in figures if np.isfinite(value))
    ends = f"keyframes {event.keyframe_a} - {event.keyframe_b}"
    return f"{event.kind.value} closure {event.closure} {event.verdict.value}: {event.reason} ({ends}; {known})"


def _is_power_of_ten(count: int) -> bool:
    return str(count).rstrip("0") == "1"
