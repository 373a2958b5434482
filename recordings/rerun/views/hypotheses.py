"""Where the robot may be in a known map, and the newest scan there where it fits best."""

import numpy as np
import rerun as rr

from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.events import HypothesesFollowed
from wayfi.recordings.rerun import arrows
from wayfi.recordings.rerun.config import RerunConfig
from wayfi.recordings.rerun.limiter import Limiter
from wayfi.recordings.rerun.stream import RerunStream, downsampled, transform
from wayfi.recordings.rerun.style import HYPOTHESIS, screen_radius
from wayfi.recordings.rerun.views.robot import ARROW
from wayfi.recordings.rerun.views.view import Handlers


class HypothesesView:
    """Draws `/map/hypotheses` without the claimed one, which is the robot, and `/map/scan`."""

    def __init__(self, stream: RerunStream, config: RerunConfig) -> None:
        self._stream = stream
        self._scan_points = config.scan_points
        self._limit = Limiter(config.scan_hz)
        style = rr.LineStrips2D.from_fields(colors=[HYPOTHESIS], radii=[screen_radius(1.5)], draw_order=18.0)
        stream.log_static("/map/hypotheses", style)

    def handlers(self) -> Handlers:
        """The method that draws each kind of event."""
        return {HypothesesFollowed: self.on_hypotheses}

    def on_hypotheses(self, event: HypothesesFollowed) -> None:
        """Draw an arrow for each, and the scan at the first."""
        if not self._limit.passes(event.stamp_ns):
            return
        others = event.T_map_base[1:] if event.claimed else event.T_map_base
        strips = rr.LineStrips2D.from_fields(strips=arrows.strips(_arrows(others)))
        self._stream.log("/map/hypotheses", strips)
        if len(event.points) and len(event.T_map_base):
            points = rr.Points2D.from_fields(positions=arrows.points(downsampled(event.points, self._scan_points)))
            self._stream.log("/map/scan", transform(Pose2.of(event.T_map_base[0])), points)


def _arrows(poses: Floats) -> list[Floats]:
    """The outline of the robot at each of `poses` (n, 3)."""
    return [Pose2.of(pose).transform(np.asarray(ARROW)) for pose in poses]
