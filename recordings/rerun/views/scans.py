"""The scan that the robot sees now, and the local submap it is matched against."""

import rerun as rr

from wayfi.frontends.events import KeyframeAdded, SubmapMatched
from wayfi.recordings.rerun import arrows
from wayfi.recordings.rerun.config import RerunConfig
from wayfi.recordings.rerun.stream import Limiter, Stream, frame, thinned
from wayfi.recordings.rerun.style import SCAN, SUBMAP, ui


class ScansView:
    """Draws `/map/scan` in the frame of its keyframe, and `/map/local_submap` in `map`."""

    def __init__(self, stream: Stream, config: RerunConfig) -> None:
        self._stream = stream
        self._most = config.scan_points
        self._scan_limit = Limiter(config.scan_hz)
        self._submap_limit = Limiter(config.scan_hz)
        points = rr.Points2D.from_fields(colors=[SCAN], radii=[ui(1.6)], draw_order=15.0)
        stream.style("/map/scan", points)
        points = rr.Points2D.from_fields(colors=[SUBMAP], radii=[ui(1.2)], draw_order=3.0)
        stream.style("/map/local_submap", points)

    def on_keyframe(self, event: KeyframeAdded) -> None:
        """The newest keyframe's scan at its pose."""
        if len(event.points) and self._scan_limit.passes(event.stamp_ns):
            points = rr.Points2D.from_fields(positions=arrows.points(thinned(event.points, self._most)))
            self._stream.log("/map/scan", frame(event.T_map_base), points)

    def on_submap(self, event: SubmapMatched) -> None:
        """The submap as the scan matching saw it."""
        if self._submap_limit.passes(event.stamp_ns):
            points = thinned(event.submap, 2 * self._most)
            self._stream.log("/map/local_submap", rr.Points2D.from_fields(positions=arrows.points(points)))
