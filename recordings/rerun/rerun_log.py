"""The events of a run as a Rerun recording: `for event in pipeline.process(measurement): log.log(event)`."""

from collections import defaultdict
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from wayfi.frontends.events import (
    ClosureJudged,
    Dropped,
    Event,
    GraphUpdated,
    KeyframeAdded,
    Warned,
)
from wayfi.recordings.rerun.blueprint import blueprint
from wayfi.recordings.rerun.config import RerunConfig
from wayfi.recordings.rerun.stream import RerunStream, flip_y
from wayfi.recordings.rerun.views.backend import BackendView
from wayfi.recordings.rerun.views.check import CheckView
from wayfi.recordings.rerun.views.closures import ClosuresView
from wayfi.recordings.rerun.views.grid import GridView
from wayfi.recordings.rerun.views.hypotheses import HypothesesView
from wayfi.recordings.rerun.views.poses import Poses
from wayfi.recordings.rerun.views.robot import RobotView
from wayfi.recordings.rerun.views.scans import ScansView
from wayfi.recordings.rerun.views.submaps import SubmapsView
from wayfi.recordings.rerun.views.text import TextView
from wayfi.recordings.rerun.views.view import View
from wayfi.recordings.rerun.views.wifi import WifiView


class RerunLog:
    """Writes events to the file `path` (None: no file), and with `serve` to viewers on 127.0.0.1:`config.port`.

    An event is logged at the latest stamp of all measurements so far, when it became known. Raises LogError if the
    file or the port is not available.
    """

    def __init__(
        self, config: RerunConfig, path: Path | None, serve: bool = False, recording_id: str = "wayfi"
    ) -> None:
        self._stream = stream = RerunStream(recording_id)
        stream.open(config, path, serve, blueprint())
        stream.log_static("/map", flip_y())
        self._poses = poses = Poses()
        self._grid, self._text = GridView(stream, config), TextView(stream)
        self._backend = BackendView(stream, config)
        self._handlers = _by_event(
            SubmapsView(stream, config, poses),
            ClosuresView(stream, config, poses),
            RobotView(stream, config),
            ScansView(stream, config),
            HypothesesView(stream, config),
            CheckView(stream, config),
            WifiView(stream, config, poses),
            self._backend,
            self._text,
            self._grid,
        )

    def log(self, event: Event) -> None:
        """Show `event`."""
        self._update_time_and_poses(event)
        for draw in self._handlers[type(event)]:
            draw(event)

    def log_durations(self, durations: Mapping[str, float]) -> None:
        """Show how many seconds each stage took, at the time of the last event."""
        self._backend.log_durations(durations)

    def close(self) -> None:
        """Show the last grid and the totals of drops, then finish the file."""
        self._grid.draw_last()
        self._text.log_totals()
        self._stream.close()

    def _update_time_and_poses(self, event: Event) -> None:
        self._stream.stamp_ns = max(self._stream.stamp_ns, self._stamp_ns(event))
        if isinstance(event, KeyframeAdded):
            self._poses.put(event.keyframe, event.T_map_base)
        if isinstance(event, GraphUpdated) and event.poses is not None:
            self._poses.replace(event.poses)
        if isinstance(event, KeyframeAdded | GraphUpdated):
            self._stream.keyframe = event.keyframe

    def _stamp_ns(self, event: Event) -> int:
        """The stamp of `event`. Not of a dropped measurement, because its stamp may be wrong."""
        if isinstance(event, ClosureJudged):
            return event.stamp_b_ns
        return self._stream.stamp_ns if isinstance(event, Dropped | Warned) else event.stamp_ns


def _by_event(*views: View) -> dict[type, list[Callable[[Any], None]]]:
    """The methods that draw each kind of event, in the order of `views`."""
    handlers: dict[type, list[Callable[[Any], None]]] = defaultdict(list)
    for view in views:
        for kind, draw in view.handlers().items():
            handlers[kind].append(draw)
    return handlers
