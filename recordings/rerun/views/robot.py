"""The robot on the map: its pose, the covariance ellipse, and the path of raw odometry."""

import numpy as np
import rerun as rr

from wayfi.backend.graph.health import State
from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.events import KeyframeAdded, PosePublished, StateChanged
from wayfi.recordings.rerun import arrows
from wayfi.recordings.rerun.config import RerunConfig
from wayfi.recordings.rerun.limiter import Limiter
from wayfi.recordings.rerun.stream import RerunStream, transform
from wayfi.recordings.rerun.style import ESTIMATE, ODOMETRY, STATE, screen_radius
from wayfi.recordings.rerun.views.view import Handlers

SIGMAS_OF_95_PERCENT = 2.4477  # radius of the 95 % circle of a 2D standard normal distribution
MAX_AXIS_M, MIN_AXIS_M = 100.0, 1e-3
ARROW = np.array([[-0.6, 0.45], [1.0, 0.0], [-0.6, -0.45], [-0.3, 0.0], [-0.6, 0.45]])
POINTS_PER_STRIP = 50


class RobotView:
    """Draws `/map/robot`, `/map/ellipse`, in the colour of the state, and `/map/odometry`."""

    def __init__(self, stream: RerunStream, config: RerunConfig) -> None:
        self._stream = stream
        self._pose_limit = Limiter(config.pose_hz)
        self._ellipse_limit = Limiter(config.pose_hz / 2)
        self._T_map_odom_first: Pose2 | None = None
        self._T_odom_base = Pose2()
        self._strip: list[tuple[float, float]] = []
        self._strips = -1
        self._state: State | None = None
        self._shown = False
        self._log_style()

    def handlers(self) -> Handlers:
        """The method that draws each kind of event."""
        return {PosePublished: self.on_pose, KeyframeAdded: self.on_keyframe, StateChanged: self.on_state}

    def on_pose(self, event: PosePublished) -> None:
        """Move the robot, and its ellipse half as often."""
        if self._T_map_odom_first is None:
            self._T_map_odom_first = event.T_map_odom
        self._T_odom_base = event.T_odom_base
        again = not self._shown
        if again:
            self._show()
        if self._pose_limit.passes(event.stamp_ns) or again:
            self._stream.log("/map/robot", transform(event.T_map_base))
        if self._ellipse_limit.passes(event.stamp_ns) or event.state != self._state:
            self._draw_ellipse(event)

    def on_state(self, event: StateChanged) -> None:
        """Hide the robot while its pose is not known; the next pose shows it again."""
        if event.state in (State.RELOCALISING, State.LOST):
            for entity in ("/map/robot/arrow", "/map/ellipse/outline"):
                self._stream.log(entity, rr.LineStrips2D.from_fields(strips=arrows.strips([])))
            self._shown, self._state = False, None

    def _show(self) -> None:
        self._stream.log("/map/robot/arrow", rr.LineStrips2D.from_fields(strips=arrows.strips([ARROW])))
        self._stream.log("/map/ellipse/outline", rr.LineStrips2D.from_fields(strips=arrows.strips([CIRCLE])))
        self._shown = True

    def on_keyframe(self, event: KeyframeAdded) -> None:  # noqa: ARG002 - only its time matters
        """Add the current pose of raw odometry to its path."""
        if self._T_map_odom_first is None:
            return
        raw = self._T_map_odom_first @ self._T_odom_base
        if len(self._strip) % POINTS_PER_STRIP == 0:
            self._strip = self._strip[-1:]
            self._strips += 1
            style = rr.LineStrips2D.from_fields(colors=[ODOMETRY], radii=[screen_radius(1.0)], draw_order=4.0)
            self._stream.log_static(f"/map/odometry/{self._strips:04d}", style)
        self._strip.append((raw.x, raw.y))
        strip = rr.LineStrips2D.from_fields(strips=arrows.strips([np.array(self._strip)]))
        self._stream.log(f"/map/odometry/{self._strips:04d}", strip)

    def _draw_ellipse(self, event: PosePublished) -> None:
        values, vectors = np.linalg.eigh(_finite(event.covariance[:2, :2]))
        axes = np.clip(SIGMAS_OF_95_PERCENT * np.sqrt(np.maximum(values, 0.0)), MIN_AXIS_M, MAX_AXIS_M)
        shape = np.eye(3)
        shape[:2, :2] = vectors * axes
        T = event.T_map_base
        self._stream.log(
            "/map/ellipse", rr.Transform3D.from_fields(translation=arrows.translation(T.x, T.y), mat3x3=shape)
        )
        if event.state != self._state:
            self._state = event.state
            self._stream.log("/map/ellipse/outline", rr.LineStrips2D.from_fields(colors=[STATE[event.state]]))

    def _log_style(self) -> None:
        arrow = rr.LineStrips2D.from_fields(colors=[ESTIMATE], radii=[screen_radius(2.0)], draw_order=21.0)
        self._stream.log_static("/map/robot/arrow", arrow)
        outline = rr.LineStrips2D.from_fields(radii=[screen_radius(1.5)], draw_order=20.0)
        self._stream.log_static("/map/ellipse/outline", outline)


def _circle() -> Floats:
    angles = np.linspace(0, 2 * np.pi, 49)
    return np.stack([np.cos(angles), np.sin(angles)], axis=1)


CIRCLE = _circle()


def _finite(covariance: Floats) -> Floats:
    return covariance if np.isfinite(covariance).all() else np.eye(2) * MAX_AXIS_M**2
