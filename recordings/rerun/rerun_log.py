"""What a run believed and why, as a Rerun recording: `for event in pipeline.process(m): log.log(event)`."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from wayfi.frontends.events import (
    CalibrationUpdated,
    CheckDone,
    ClosureJudged,
    Dropped,
    Event,
    FingerprintAdded,
    GraphUpdated,
    GridRedrawn,
    KeyframeAdded,
    PosePublished,
    SequenceMatched,
    StateChanged,
    SubmapMatched,
    Warned,
)
from wayfi.recordings.log import Log, NullLog
from wayfi.recordings.rerun.blueprint import blueprint
from wayfi.recordings.rerun.config import RerunConfig
from wayfi.recordings.rerun.stream import Stream, mirror
from wayfi.recordings.rerun.views.backend import BackendView
from wayfi.recordings.rerun.views.check import CheckView
from wayfi.recordings.rerun.views.closures import ClosuresView
from wayfi.recordings.rerun.views.grid import GridView
from wayfi.recordings.rerun.views.poses import Poses
from wayfi.recordings.rerun.views.robot import RobotView
from wayfi.recordings.rerun.views.scans import ScansView
from wayfi.recordings.rerun.views.submaps import SubmapsView
from wayfi.recordings.rerun.views.text import TextLog
from wayfi.recordings.rerun.views.wifi import WifiView


def open_log(config: RerunConfig, path: Path | None, serve: bool = False, recording_id: str = "wayfi") -> Log:
    """A RerunLog, or a NullLog where the log is off or has nowhere to go."""
    if config.enabled and (serve or path is not None):
        return RerunLog(config, path, serve, recording_id)
    return NullLog()


class RerunLog:
    """Shows events in the file `path`, live on 127.0.0.1:`config.port` where `serve`, or both.

    An event is shown at the moment it was known: the latest stamp of what was measured so far. Raises LogError where
    the file or the port cannot be had.
    """

    def __init__(
        self, config: RerunConfig, path: Path | None, serve: bool = False, recording_id: str = "wayfi"
    ) -> None:
        self._stream = stream = Stream(recording_id)
        stream.open(config, path, serve, blueprint())
        stream.style("/map", mirror())
        self._poses = Poses()
        self._text = TextLog(stream)
        self._grid = GridView(stream, config)
        self._backend = BackendView(stream, config)
        self._shown_by = self._views(config)

    def log(self, event: Event) -> None:
        """Show `event`."""
        self._advance(event)
        for show in self._shown_by[type(event)]:
            show(event)

    def log_durations(self, durations: Mapping[str, float]) -> None:
        """Show how many seconds each stage took, at the moment of the last event."""
        self._backend.log_durations(durations)

    def close(self) -> None:
        """Show what was held back, and finish the file."""
        self._grid.draw_waiting()
        self._text.log_totals()
        self._stream.close()

    def _views(self, config: RerunConfig) -> dict[type, tuple[Callable[[Any], None], ...]]:
        """Who shows which event, in this order."""
        stream, poses, text, backend = self._stream, self._poses, self._text, self._backend
        robot, scans, check = RobotView(stream, config), ScansView(stream, config), CheckView(stream, config)
        submaps, closures = SubmapsView(stream, config, poses), ClosuresView(stream, config, poses)
        wifi = WifiView(stream, config, poses)
        return {
            PosePublished: (robot.on_pose, backend.on_pose),
            KeyframeAdded: (submaps.on_keyframe, robot.on_keyframe, scans.on_keyframe, check.on_keyframe),
            SubmapMatched: (scans.on_submap,),
            FingerprintAdded: (wifi.on_fingerprint,),
            SequenceMatched: (wifi.on_sequences,),
            CheckDone: (check.on_check,),
            ClosureJudged: (closures.on_closure, text.on_closure),
            GraphUpdated: (submaps.on_graph, closures.on_graph, backend.on_graph),
            CalibrationUpdated: (backend.on_calibration,),
            StateChanged: (backend.on_state, text.on_state),
            Dropped: (text.on_drop,),
            Warned: (text.on_warning,),
            GridRedrawn: (self._grid.on_grid,),
        }

    def _advance(self, event: Event) -> None:
        self._stream.stamp_ns = max(self._stream.stamp_ns, self._moment_ns(event))
        if isinstance(event, KeyframeAdded):
            self._poses.put(event.keyframe, event.T_map_base)
        if isinstance(event, GraphUpdated) and event.poses is not None:
            self._poses.replace(event.poses)
        if isinstance(event, KeyframeAdded | GraphUpdated):
            self._stream.keyframe = event.keyframe

    def _moment_ns(self, event: Event) -> int:
        """The stamp that `event` brings; a dropped measurement's stamp may be the very thing that is wrong."""
        if isinstance(event, ClosureJudged):
            return event.stamp_b_ns
        return self._stream.stamp_ns if isinstance(event, Dropped | Warned) else event.stamp_ns
