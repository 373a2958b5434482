"""The robot on the map: its pose, how sure it is, and where raw odometry alone would have it."""

import numpy as np
import rerun as rr

from wayfi.backend.graph.health import State
from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.events import KeyframeAdded, PosePublished
from wayfi.recordings.rerun import arrows
from wayfi.recordings.rerun.config import RerunConfig
from wayfi.recordings.rerun.stream import Limiter, Stream, frame
from wayfi.recordings.rerun.style import ESTIMATE, ODOMETRY, STATE, ui

WITHIN_95 = 2.4477  # radius of the 95 % circle of a plane's unit normal distribution
WIDEST_M, NARROWEST_M = 100.0, 1e-3
ARROW = np.array([[-0.6, 0.45], [1.0, 0.0], [-0.6, -0.45], [-0.3, 0.0], [-0.6, 0.45]])
ODOMETRY_STRIP = 50


class RobotView:
    """Draws `/map/robot`, `/map/ellipse` and `/map/odometry`; the state colours the ellipse."""

    def __init__(self, stream: Stream, config: RerunConfig) -> None:
        self._stream = stream
        self._pose_limit = Limiter(config.pose_hz)
        self._ellipse_limit = Limiter(config.pose_hz / 2)
        self._T_map_odom_first: Pose2 | None = None
        self._T_odom_base = Pose2()
        self._strip: list[tuple[float, float]] = []
        self._strips = -1
        self._state: State | None = None
        self._style()

    def on_pose(self, event: PosePublished) -> None:
        """The robot moves; its ellipse half as often."""
        if self._T_map_odom_first is None:
            self._T_map_odom_first = event.T_map_odom
        self._T_odom_base = event.T_odom_base
        if self._pose_limit.passes(event.stamp_ns):
            self._stream.log("/map/robot", frame(event.T_map_base))
        if self._ellipse_limit.passes(event.stamp_ns) or event.state != self._state:
            self._draw_ellipse(event)

    def on_keyframe(self, event: KeyframeAdded) -> None:  # noqa: ARG002 - the moment is what counts
        """The path of raw odometry grows by one point."""
        if self._T_map_odom_first is None:
            return
        raw = self._T_map_odom_first @ self._T_odom_base
        if len(self._strip) % ODOMETRY_STRIP == 0:
            self._strip = self._strip[-1:]
            self._strips += 1
            style = rr.LineStrips2D.from_fields(colors=[ODOMETRY], radii=[ui(1.0)], draw_order=4.0)
            self._stream.style(f"/map/odometry/{self._strips:04d}", style)
        self._strip.append((raw.x, raw.y))
        strip = rr.LineStrips2D.from_fields(strips=arrows.strips([np.array(self._strip)]))
        self._stream.log(f"/map/odometry/{self._strips:04d}", strip)

    def _draw_ellipse(self, event: PosePublished) -> None:
        values, vectors = np.linalg.eigh(_finite(event.covariance[:2, :2]))
        axes = np.clip(WITHIN_95 * np.sqrt(np.maximum(values, 0.0)), NARROWEST_M, WIDEST_M)
        shape = np.eye(3)
        shape[:2, :2] = vectors * axes
        T = event.T_map_base
        self._stream.log(
            "/map/ellipse", rr.Transform3D.from_fields(translation=arrows.translation(T.x, T.y), mat3x3=shape)
        )
        if event.state != self._state:
            self._state = event.state
            self._stream.log("/map/ellipse/outline", rr.LineStrips2D.from_fields(colors=[STATE[event.state]]))

    def _style(self) -> None:
        arrow = rr.LineStrips2D([ARROW], colors=[ESTIMATE], radii=[ui(2.0)], draw_order=21.0)
        self._stream.style("/map/robot/arrow", arrow)
        angles = np.linspace(0, 2 * np.pi, 49)
        circle = np.stack([np.cos(angles), np.sin(angles)], axis=1)
        self._stream.style(
            "/map/ellipse/outline", rr.LineStrips2D.from_fields(strips=[circle], radii=[ui(1.5)], draw_order=20.0)
        )


def _finite(covariance: Floats) -> Floats:
    return covariance if np.isfinite(covariance).all() else np.eye(2) * WIDEST_M**2
