"""Loop candidates as lines between their keyframes, coloured by verdict; corrections move them."""

from dataclasses import dataclass

import numpy as np
import rerun as rr

from wayfi.backend.pose2 import Floats
from wayfi.frontends.events import ClosureJudged, GraphUpdated, Verdict
from wayfi.recordings.rerun import arrows
from wayfi.recordings.rerun.config import RerunConfig
from wayfi.recordings.rerun.stream import RerunStream, segments
from wayfi.recordings.rerun.style import VERDICT, screen_radius
from wayfi.recordings.rerun.views.poses import Poses
from wayfi.recordings.rerun.views.view import Handlers

REDRAW_M = 0.1
WIDTH = {Verdict.ACCEPTED: 1.3, Verdict.REFUSED: 0.4, Verdict.REMOVED: 1.6}
ORDER = {Verdict.ACCEPTED: 6.0, Verdict.REFUSED: 5.0, Verdict.REMOVED: 7.0}

Group = tuple[Verdict, int]


@dataclass
class _Lines:
    """The candidates of one verdict whose keyframe b is in one submap.

    `ends` are (keyframe_a, keyframe_b) by closure, `drawn` (n, 4) is x, y of a and of b as last drawn.
    """

    ends: dict[int, tuple[int, int]]
    drawn: Floats


class ClosuresView:
    """Draws `/map/closures/VERDICT/NNNN`: a few lines in each entity, so that a change redraws few of them."""

    def __init__(self, stream: RerunStream, config: RerunConfig, poses: Poses) -> None:
        self._stream = stream
        self._submap_keyframes = config.submap_keyframes
        self._poses = poses
        self._groups: dict[Group, _Lines] = {}
        self._group_of: dict[int, Group] = {}

    def handlers(self) -> Handlers:
        """The method that draws each kind of event."""
        return {ClosureJudged: self.on_closure, GraphUpdated: self.on_graph}

    def on_closure(self, event: ClosureJudged) -> None:
        """Draw the line of a new candidate, or move it to the group of its new verdict."""
        before = self._group_of.get(event.closure)
        group = (event.verdict, event.keyframe_b // self._submap_keyframes)
        if before is not None:
            del self._groups[before].ends[event.closure]
            self._draw(before)
        self._group_of[event.closure] = group
        lines = self._groups.setdefault(group, _Lines({}, np.zeros((0, 4))))
        if not lines.ends:
            self._log_style(group)
        lines.ends[event.closure] = (event.keyframe_a, event.keyframe_b)
        self._draw(group)

    def on_graph(self, event: GraphUpdated) -> None:
        """Redraw the lines whose ends have moved."""
        if event.poses is None:
            return
        for group, lines in self._groups.items():
            if np.abs(self._ends(lines) - lines.drawn).max(initial=0.0) > REDRAW_M:
                self._draw(group)

    def _ends(self, lines: _Lines) -> Floats:
        """(n, 4) x, y of a and of b, in `map`."""
        keyframes = np.array(list(lines.ends.values()), np.int64).reshape(-1, 2)
        return self._poses.array()[keyframes, :2].reshape(-1, 4)

    def _draw(self, group: Group) -> None:
        lines = self._groups[group]
        lines.drawn = self._ends(lines)
        strips = segments(lines.drawn[:, :2], lines.drawn[:, 2:])
        self._stream.log(_path(group), rr.LineStrips2D.from_fields(strips=arrows.strips(strips)))

    def _log_style(self, group: Group) -> None:
        verdict = group[0]
        color, radius, order = VERDICT[verdict], screen_radius(WIDTH[verdict]), ORDER[verdict]
        style = rr.LineStrips2D.from_fields(colors=[color], radii=[radius], draw_order=order)
        self._stream.log_static(_path(group), style)


def _path(group: Group) -> str:
    return f"/map/closures/{group[0].value}/{group[1]:04d}"
