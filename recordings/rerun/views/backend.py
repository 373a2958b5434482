"""The back end as curves: residual, factors, time by stage, calibration, state and the sigma of the pose."""

from collections.abc import Mapping

import numpy as np
import rerun as rr

from wayfi.backend.graph.health import State
from wayfi.frontends.events import CalibrationUpdated, GraphUpdated, PosePublished, StateChanged, Verdict
from wayfi.recordings.rerun.config import RerunConfig
from wayfi.recordings.rerun.limiter import Limiter
from wayfi.recordings.rerun.stream import RerunStream
from wayfi.recordings.rerun.style import ESTIMATE, ODOMETRY, STATE, VERDICT
from wayfi.recordings.rerun.views.view import Handlers

STAGES = ("scan_points", "scan_matching", "backend", "closure", "wifi")
CALIBRATION = ("scale of distance", "scale of turning", "bias, rad/m", "bias, rad/s")


class BackendView:
    """Draws `/backend`."""

    def __init__(self, stream: RerunStream, config: RerunConfig) -> None:
        self._stream = stream
        self._sigma_limit = Limiter(config.pose_hz / 2)
        self._log_style()

    def handlers(self) -> Handlers:
        """The method that draws each kind of event."""
        return {
            GraphUpdated: self.on_graph,
            PosePublished: self.on_pose,
            StateChanged: self.on_state,
            CalibrationUpdated: self.on_calibration,
        }

    def on_graph(self, event: GraphUpdated) -> None:
        """Draw the residual and the number of factors after an update."""
        self._scalars("residual", event.residual)
        self._scalars("factors/in_and_out", event.factors_added, -event.factors_removed)
        self._scalars("factors/total", event.factors)

    def on_pose(self, event: PosePublished) -> None:
        """Draw one sigma of the position (m) and of the heading (degrees)."""
        if self._sigma_limit.passes(event.stamp_ns):
            x, y, theta = np.sqrt(np.maximum(np.diag(event.covariance), 0.0))
            self._scalars("sigma", np.hypot(x, y), np.degrees(theta))

    def on_state(self, event: StateChanged) -> None:
        """Draw the state."""
        self._stream.log("/backend/state", rr.StateChange(state=event.state.value))

    def on_calibration(self, event: CalibrationUpdated) -> None:
        """Draw the four parameters of the wheels' calibration."""
        self._scalars("calibration", *event.values)

    def log_durations(self, durations: Mapping[str, float]) -> None:
        """Draw seconds by stage as milliseconds; a gap for a stage that did not run."""
        self._scalars("time", *(1e3 * durations.get(stage, np.nan) for stage in STAGES))

    def _scalars(self, name: str, *values: float) -> None:
        self._stream.log(f"/backend/{name}", rr.Scalars.from_fields(scalars=np.array(values, np.float64)))

    def _log_style(self) -> None:
        log_static = self._stream.log_static
        green, purple = VERDICT[Verdict.ACCEPTED], VERDICT[Verdict.REMOVED]
        log_static("/backend/residual", rr.SeriesLines(names="residual of the graph", colors=[ESTIMATE]))
        in_and_out = rr.SeriesLines(names=["factors in", "factors out"], colors=[green, purple])
        log_static("/backend/factors/in_and_out", in_and_out)
        log_static("/backend/factors/total", rr.SeriesLines(names="factors", colors=[ODOMETRY]))
        log_static("/backend/sigma", rr.SeriesLines(names=["sigma of position, m", "sigma of heading, °"]))
        log_static("/backend/time", rr.SeriesLines(names=[f"{stage}, ms" for stage in STAGES]))
        log_static("/backend/calibration", rr.SeriesLines(names=CALIBRATION))
        values, colors = [s.value for s in State], [STATE[s] for s in State]
        log_static("/backend/state", rr.StateConfiguration(values=values, labels=values, colors=colors))
