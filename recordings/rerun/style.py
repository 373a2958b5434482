"""The colours of all views, chosen for a dark background."""

import rerun as rr

from wayfi.backend.graph.health import State
from wayfi.frontends.events import Verdict

Color = tuple[int, int, int]

ESTIMATE: Color = (70, 165, 255)
ODOMETRY: Color = (125, 125, 125)
SCAN: Color = (255, 205, 60)
SUBMAP: Color = (120, 140, 160)
KEYFRAME_SCAN: Color = (52, 88, 104)
GUESS: Color = (255, 120, 90)
MATCHED: Color = (90, 225, 130)
SEQUENCE_A: Color = (70, 165, 255)
SEQUENCE_B: Color = (255, 205, 60)
PAIRING: Color = (90, 90, 90)
HERE: Color = (255, 255, 255)
HYPOTHESIS: Color = (200, 140, 255)

VERDICT: dict[Verdict, Color] = {
    Verdict.ACCEPTED: (70, 215, 110),
    Verdict.REFUSED: (100, 48, 26),
    Verdict.REMOVED: (190, 90, 255),
}
STATE: dict[State, Color] = {
    State.RELOCALISING: (200, 140, 255),
    State.TRACKING: (70, 215, 110),
    State.UNCERTAIN: (255, 165, 40),
    State.LOST: (255, 70, 70),
}


def screen_radius(points: float) -> rr.components.Radius:
    """A radius of `points` on the screen, independent of the zoom."""
    return rr.components.Radius(-points)  # a negative radius is in screen units
