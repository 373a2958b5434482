"""The scan-matching check of a loop candidate: the scan over the submap, before and after."""

import numpy as np
import rerun as rr

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.events import CheckDone, KeyframeAdded
from wayfi.recordings.rerun import arrows
from wayfi.recordings.rerun.config import RerunConfig
from wayfi.recordings.rerun.stream import RerunStream, downsampled, flip_y
from wayfi.recordings.rerun.style import GUESS, MATCHED, SUBMAP, screen_radius
from wayfi.recordings.rerun.views.view import Handlers


class CheckView:
    """Draws `/check/scans`, in base_link of keyframe a, `/check/inlier_ratio` and `/check/result`."""

    def __init__(self, stream: RerunStream, config: RerunConfig) -> None:
        self._stream = stream
        self._scan_points = config.scan_points
        stream.log_static("/check/scans", flip_y())
        for name, color, order in (("submap", SUBMAP, 1.0), ("before", GUESS, 2.0), ("after", MATCHED, 2.0)):
            points = rr.Points2D.from_fields(colors=[color], radii=[screen_radius(1.8)], draw_order=order)
            stream.log_static(f"/check/scans/{name}", points)
        stream.log_static("/check/inlier_ratio/closure", rr.SeriesPoints(names="of a candidate", colors=[MATCHED]))
        stream.log_static("/check/inlier_ratio/matching", rr.SeriesLines(names="of scan matching", colors=[SUBMAP]))

    def handlers(self) -> Handlers:
        """The method that draws each kind of event."""
        return {CheckDone: self.on_check, KeyframeAdded: self.on_keyframe}

    def on_check(self, event: CheckDone) -> None:
        """Draw the newest check."""
        self._points("submap", downsampled(event.submap, 2 * self._scan_points))
        scan = downsampled(event.scan, self._scan_points).astype(np.float64)
        self._points("before", event.T_a_b_guess.transform(scan))
        self._points("after", event.T_a_b.transform(scan))
        self._stream.log("/check/inlier_ratio/closure", rr.Scalars.from_fields(scalars=[event.inlier_ratio]))
        self._stream.log("/check/result", rr.TextDocument(_summary(event), media_type="text/markdown"))

    def on_keyframe(self, event: KeyframeAdded) -> None:
        """Draw the inlier ratio of the keyframe's scan matching."""
        if np.isfinite(event.inlier_ratio):
            self._stream.log("/check/inlier_ratio/matching", rr.Scalars.from_fields(scalars=[event.inlier_ratio]))

    def _points(self, name: str, points: np.ndarray[tuple[int, int], np.dtype[np.floating]]) -> None:
        self._stream.log(f"/check/scans/{name}", rr.Points2D.from_fields(positions=arrows.points(points)))


def _summary(event: CheckDone) -> str:
    moved = _moved(event.T_a_b_guess, event.T_a_b)
    return (
        f"Keyframe **{event.keyframe_b}** against the submap of **{event.keyframe_a}**: inlier ratio "
        f"**{event.inlier_ratio:.2f}**, runner-up at {event.second_peak:.2f} of the best, {moved}"
    )


def _moved(guess: Pose2, found: Pose2) -> str:
    moved = guess.between(found)
    return f"moved by {guess.distance(found):.2f} m and {np.degrees(moved.theta):.1f}°"
