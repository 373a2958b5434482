"""A storey of a small building: its walls, its furniture and its access points, each of which may change overnight."""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from wayfi.backend.pose2 import Floats, Pose2
from wayfi.recordings.simulation.radio import RadioEnvironment, RadioPlan, draw_radio
from wayfi.recordings.simulation.surfaces import Surfaces, box, join, still, transformed

WIDTH_M, DEPTH_M = 26.0, 15.0
INSIDE = (0.0, 0.0, WIDTH_M, DEPTH_M)
ROUTE = (
    *((2.0, 7.5), (24.0, 7.5), (24.0, 12.5), (16.0, 12.5), (16.0, 7.5), (9.0, 7.5), (9.0, 2.5), (3.0, 2.5), (9.0, 2.5)),
    *((9.0, 7.5), (2.0, 7.5)),
)
PIECES_OF_FURNITURE = 24
CABIN_XY = (12.0, 10.0)  # of an elevator, behind the wall of the corridor
CABIN_DOOR = np.array([[11.2, 9.0, 12.8, 9.0]])
EVER = 1e9


def _wall(x1: float, y1: float, x2: float, y2: float, *gaps: tuple[float, float]) -> Floats:
    """A straight wall along x or y, with gaps from one share of its length to another."""
    start, along = np.array([x1, y1]), np.array([x2 - x1, y2 - y1])
    ends = [0.0, *(share for gap in gaps for share in gap), 1.0]
    return np.array([[*(start + a * along), *(start + b * along)] for a, b in zip(ends[::2], ends[1::2], strict=True)])


WALLS = np.concatenate(
    [
        box(*INSIDE),
        _wall(0.0, 6.0, WIDTH_M, 6.0, (0.31, 0.38), (0.70, 0.76)),  # rooms below the corridor
        _wall(6.0, 0.0, 6.0, 6.0, (0.35, 0.55)),
        _wall(13.0, 0.0, 13.0, 6.0),
        _wall(20.0, 0.0, 20.0, 6.0),
        _wall(0.0, 9.0, WIDTH_M, 9.0, (0.431, 0.492), (0.59, 0.64), (0.90, 0.95)),  # and above it; the first: elevator
        _wall(14.0, 9.0, 14.0, DEPTH_M),
        _wall(5.0, 9.0, 5.0, DEPTH_M),
        _wall(11.2, 9.0, 11.2, 11.0),
        _wall(12.8, 9.0, 12.8, 11.0),
        _wall(11.2, 11.0, 12.8, 11.0),
        box(19.6, 9.3, 20.4, 10.1),
    ]
)


@dataclass(frozen=True)
class Storey:
    """What is there: `walls` and `furniture` (n, 4), faces that stand for a time in `passing`, access points."""

    walls: Floats
    furniture: Floats
    radio: RadioEnvironment | None
    passing: tuple[Surfaces, ...] = ()

    def surfaces(self) -> Surfaces:
        """All that a laser sees."""
        return join([still(np.concatenate([self.walls, self.furniture])), *self.passing])

    def refurnished(self, seed: int) -> "Storey":
        """All furniture in other places."""
        return replace(self, furniture=furniture(seed))

    def with_other_access_points(self) -> "Storey":
        """Every access point replaced by one of another make, at other places."""
        return replace(self, radio=_radio(1999, "other"))

    def with_moved_access_points(self, share: float) -> "Storey":
        """This share of the sites moved to where others of them were."""
        assert self.radio is not None
        site = self.radio.site.copy()
        moved = np.random.default_rng(5).permutation(site.max() + 1)[: round(share * (site.max() + 1))]
        to = dict(zip(moved.tolist(), np.roll(moved, 1).tolist(), strict=True))
        return replace(self, radio=replace(self.radio, site=np.array([to.get(s, s) for s in site.tolist()])))

    def with_elevator_closed(self, until_s: float) -> "Storey":
        """The elevator's door is closed until then."""
        return replace(self, passing=(still(CABIN_DOOR, until_s=until_s),))


def storey(seed: int = 0) -> Storey:
    """The storey, with furniture and access points by the seed; the elevator is closed."""
    return Storey(WALLS, furniture(seed), _radio(seed)).with_elevator_closed(EVER)


TWIN_ROUTE = (
    *((3.0, 3.0), (8.0, 3.0), (8.0, 7.0), (3.0, 7.0), (3.0, 3.0), (8.0, 3.0), (8.0, 10.5), (38.0, 10.5), (38.0, 3.0)),
    *((33.0, 3.0), (33.0, 7.0), (38.0, 7.0), (38.0, 10.5), (8.0, 10.5), (8.0, 7.0)),
)


def twin_halls() -> Storey:
    """Two halls with the same walls and furniture, 30 m apart, on one corridor."""
    hall = np.concatenate(
        [
            np.array([[0.0, 9.0, 0.0, 0.0], [0.0, 0.0, 11.0, 0.0], [11.0, 0.0, 11.0, 9.0]]),
            _wall(0.0, 9.0, 11.0, 9.0, (0.66, 0.80)),
            box(4.5, 4.0, 6.5, 5.0),
            box(0.4, 0.4, 1.2, 2.4),
            box(9.6, 0.3, 10.7, 0.9),
        ]
    )
    other = hall + np.array([30.0, 0.0, 30.0, 0.0])
    corridor = np.array(
        [[0.0, 12.0, 41.0, 12.0], [0.0, 9.0, 0.0, 12.0], [41.0, 9.0, 41.0, 12.0], [11.0, 9.0, 30.0, 9.0]]
    )
    return Storey(np.concatenate([hall, other, corridor]), np.zeros((0, 4)), _radio(4))


def another_building(seed: int = 0) -> Storey:
    """A building of other walls and access points."""
    turned = transformed(WALLS * np.array([0.8, 1.15, 0.8, 1.15]), Pose2())
    mirrored = turned * np.array([1.0, -1.0, 1.0, -1.0]) + np.array([0.0, 17.25, 0.0, 17.25])
    return Storey(mirrored, furniture(seed + 50) * 0.8, _radio(seed + 900, "another"))


def furniture(seed: int) -> Floats:
    """Boxes along the walls of the rooms, none of them in the way."""
    rng = np.random.default_rng(seed)
    boxes = []
    while len(boxes) < PIECES_OF_FURNITURE:
        x, y = rng.uniform(0.8, WIDTH_M - 2.0), rng.choice([0.3, 4.6, 9.4, 13.9])
        w, h = rng.uniform(0.4, 1.6), rng.uniform(0.3, 0.8)
        near = np.hypot(*(np.array([x + w / 2, y + h / 2]) - _places_of_the_route()).T).min()
        if near > 1.2 and not (10.5 < x < 13.5 and y > 8.0):
            boxes.append(box(x, y, x + w, y + h))
    return np.concatenate(boxes)


def _places_of_the_route() -> Floats:
    corners = np.array(ROUTE)
    steps = [np.linspace(a, b, 40) for a, b in pairwise(corners)]
    return np.concatenate(steps)


def _radio(seed: int, name: str = "") -> RadioEnvironment:
    plan = RadioPlan(INSIDE, inside_sites=12, margin_m=30.0, outside_sites=14, hotspots=0)
    drawn = draw_radio(plan, EVER / 1e6, np.random.default_rng(seed))
    return replace(drawn, ssids=tuple(f"{name}{ssid}" for ssid in drawn.ssids))
