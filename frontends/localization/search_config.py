"""The settings of the search of the whole map."""

from dataclasses import dataclass

from wayfi.backend.options import option


@dataclass(frozen=True)
class MapSearchConfig:
    """How a scan is searched for all over a map, and which of the places where it fits are told."""

    cell_m: float = option(0.2, "m", "of the poses compared all over the map; what fits is refined")
    angle_step: float = option(0.02, "rad", "0.2 m at 10 m, which the blur covers")
    blur_m: float = option(0.2, "m", "how far a point may lie from a wall and still support it")
    points: int = option(150, "", "compared all over the map: more change the best poses by less than a cell")
    fine_blur_m: float = option(
        0.08, "m", "the same where poses are refined: what a map bends by, and less than a door"
    )
    fine_points: int = option(300, "", "compared where poses are refined: look-alikes differ in few of them")
    min_points: int = option(40, "", "after thinning: fewer fit in many places")
    min_score: float = option(0.45, "", "of the points that fit: less is chance")
    refined_share: float = option(0.8, "", "of the best score by whole cells: poses that fit as well are refined")
    rival_share: float = option(0.85, "", "of the best score: a place that fits as well as this may be the true one")
    most: int = option(20, "places", "that are told of one search")
    most_refined: int = option(4000, "poses", "refined in one search: an aisle has hundreds that fit alike")
    apart_m: float = option(1.0, "m", "nearer than this, two poses are one place")
    apart_rad: float = option(0.3, "rad", "as above")
    max_poses: int = option(40_000_000, "poses", "compared in one search: bounds its cost")
    max_waiting: int = option(4_000_000, "blocks", "of poses that wait to be divided: bounds the memory to 32 MB")
