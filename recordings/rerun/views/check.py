"""The bounded check of a candidate: its scan over the submap, before and after."""

import numpy as np
import rerun as rr

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.events import CheckDone, KeyframeAdded
from wayfi.recordings.rerun import arrows
from wayfi.recordings.rerun.config import RerunConfig
from wayfi.recordings.rerun.stream import Stream, mirror, thinned
from wayfi.recordings.rerun.style import GUESS, MATCHED, SUBMAP, ui


class CheckView:
    """Draws `/check/scans` in base_link of keyframe a, and the inlier ratios below `/check/inlier_ratio`."""

    def __init__(self, stream: Stream, config: RerunConfig) -> None:
        self._stream = stream
        self._most = config.scan_points
        stream.style("/check/scans", mirror())
        for name, color, order in (("submap", SUBMAP, 1.0), ("before", GUESS, 2.0), ("after", MATCHED, 2.0)):
            points = rr.Points2D.from_fields(colors=[color], radii=[ui(1.8)], draw_order=order)
            stream.style(f"/check/scans/{name}", points)
        stream.style("/check/inlier_ratio/closure", rr.SeriesPoints(names="of a candidate", colors=[MATCHED]))
        stream.style("/check/inlier_ratio/matching", rr.SeriesLines(names="of scan matching", colors=[SUBMAP]))

    def on_check(self, event: CheckDone) -> None:
        """The newest check."""
        self._points("submap", thinned(event.submap, 2 * self._most))
        scan = thinned(event.scan, self._most).astype(np.float64)
        self._points("before", event.T_a_b_guess.transform(scan))
        self._points("after", event.T_a_b.transform(scan))
        self._stream.log("/check/inlier_ratio/closure", rr.Scalars.from_fields(scalars=[event.inlier_ratio]))
        self._stream.log("/check/result", rr.TextDocument(_summary(event), media_type="text/markdown"))

    def on_keyframe(self, event: KeyframeAdded) -> None:
        """The inlier ratio of the keyframe's scan matching."""
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
