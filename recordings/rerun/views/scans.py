"""The current scan, and the local submap that it is matched with."""

import rerun as rr

from wayfi.frontends.events import KeyframeAdded, SubmapMatched
from wayfi.recordings.rerun import arrows
from wayfi.recordings.rerun.config import RerunConfig
from wayfi.recordings.rerun.limiter import Limiter
from wayfi.recordings.rerun.stream import RerunStream, downsampled, transform
from wayfi.recordings.rerun.style import SCAN, SUBMAP, screen_radius
from wayfi.recordings.rerun.views.view import Handlers


class ScansView:
    """Draws `/map/scan` in base_link of its keyframe, and `/map/local_submap` in `map`."""

    def __init__(self, stream: RerunStream, config: RerunConfig) -> None:
        self._stream = stream
        self._scan_points = config.scan_points
        self._scan_limit = Limiter(config.scan_hz)
        self._submap_limit = Limiter(config.scan_hz)
        points = rr.Points2D.from_fields(colors=[SCAN], radii=[screen_radius(1.6)], draw_order=15.0)
        stream.log_static("/map/scan", points)
        points = rr.Points2D.from_fields(colors=[SUBMAP], radii=[screen_radius(1.2)], draw_order=3.0)
        stream.log_static("/map/local_submap", points)

    def handlers(self) -> Handlers:
        """The method that draws each kind of event."""
        return {KeyframeAdded: self.on_keyframe, SubmapMatched: self.on_submap}

    def on_keyframe(self, event: KeyframeAdded) -> None:
        """Draw the newest keyframe's scan at its pose."""
        if len(event.points) and self._scan_limit.passes(event.stamp_ns):
            points = rr.Points2D.from_fields(positions=arrows.points(downsampled(event.points, self._scan_points)))
            self._stream.log("/map/scan", transform(event.T_map_base), points)

    def on_submap(self, event: SubmapMatched) -> None:
        """Draw the submap of the last scan matching."""
        if self._submap_limit.passes(event.stamp_ns):
            points = downsampled(event.submap, 2 * self._scan_points)
            self._stream.log("/map/local_submap", rr.Points2D.from_fields(positions=arrows.points(points)))
