"""The back end in curves: residual, factors, time of a stage, calibration, state and how sure the pose is."""

from collections.abc import Mapping

import numpy as np
import rerun as rr

from wayfi.backend.graph.health import State
from wayfi.frontends.events import CalibrationUpdated, GraphUpdated, PosePublished, StateChanged, Verdict
from wayfi.recordings.rerun.config import RerunConfig
from wayfi.recordings.rerun.stream import Limiter, Stream
from wayfi.recordings.rerun.style import ESTIMATE, ODOMETRY, STATE, VERDICT

STAGES = ("scan_points", "scan_matching", "backend", "closure", "wifi")
CALIBRATION = ("scale of distance", "scale of turning", "bias, rad/m", "bias, rad/s")


class BackendView:
    """Draws below `/backend`."""

    def __init__(self, stream: Stream, config: RerunConfig) -> None:
        self._stream = stream
        self._sigma_limit = Limiter(config.pose_hz / 2)
        self._style()

    def on_graph(self, event: GraphUpdated) -> None:
        """Residual and factors after an update."""
        self._scalars("residual", event.residual)
        self._scalars("factors/in_and_out", event.factors_added, -event.factors_removed)
        self._scalars("factors/total", event.factors)

    def on_pose(self, event: PosePublished) -> None:
        """One sigma of the position and the heading."""
        if self._sigma_limit.passes(event.stamp_ns):
            x, y, theta = np.sqrt(np.maximum(np.diag(event.covariance), 0.0))
            self._scalars("sigma", np.hypot(x, y), np.degrees(theta))

    def on_state(self, event: StateChanged) -> None:
        """TRACKING, UNCERTAIN or LOST."""
        self._stream.log("/backend/state", rr.StateChange(state=event.state.value))

    def on_calibration(self, event: CalibrationUpdated) -> None:
        """The wheels' four numbers."""
        self._scalars("calibration", *event.values)

    def log_durations(self, durations: Mapping[str, float]) -> None:
        """Seconds by stage, shown in milliseconds; a stage that did not run is a gap."""
        self._scalars("time", *(1e3 * durations.get(stage, np.nan) for stage in STAGES))

    def _scalars(self, name: str, *values: float) -> None:
        self._stream.log(f"/backend/{name}", rr.Scalars.from_fields(scalars=np.array(values, np.float64)))

    def _style(self) -> None:
        style = self._stream.style
        green, purple = VERDICT[Verdict.ACCEPTED], VERDICT[Verdict.REMOVED]
        style("/backend/residual", rr.SeriesLines(names="residual of the graph", colors=[ESTIMATE]))
        in_and_out = rr.SeriesLines(names=["factors in", "factors out"], colors=[green, purple])
        style("/backend/factors/in_and_out", in_and_out)
        style("/backend/factors/total", rr.SeriesLines(names="factors", colors=[ODOMETRY]))
        style("/backend/sigma", rr.SeriesLines(names=["sigma of position, m", "sigma of heading, °"]))
        style("/backend/time", rr.SeriesLines(names=[f"{stage}, ms" for stage in STAGES]))
        style("/backend/calibration", rr.SeriesLines(names=CALIBRATION))
        values, colors = [s.value for s in State], [STATE[s] for s in State]
        style("/backend/state", rr.StateConfiguration(values=values, labels=values, colors=colors))
