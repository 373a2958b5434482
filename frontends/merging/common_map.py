"""The one map of several drives in one building: each is joined to the others where that is certain."""

from collections.abc import Mapping
from dataclasses import dataclass

from wayfi.backend.errors import WayfiError
from wayfi.backend.pose2 import Pose2
from wayfi.frontends.maps.building_map import BuildingMap
from wayfi.frontends.maps.pruning import pruned
from wayfi.frontends.merging.merging import merge
from wayfi.frontends.slam_config import SlamConfig


@dataclass(frozen=True, slots=True, eq=False)
class CommonMap:
    """The joined map, and by the name of each part T_common_map where its newest keyframe lies, or why it is left out.

    A part's own map bends differently from the joined one: near what its robot saw last, `places` is exact.
    """

    building: BuildingMap
    places: Mapping[str, Pose2]
    left_out: Mapping[str, str]


def common_map(parts: Mapping[str, BuildingMap], config: SlamConfig) -> CommonMap:
    """Join the maps of `parts`, which are not empty, in the frame of the first.

    One that does not join is tried again when another has: it may overlap with that one alone. What several parts have
    seen is kept once.
    """
    (root, building), *others = parts.items()
    newest = {root: len(building.keyframes) - 1}
    waiting, left_out = dict(others), dict[str, str]()
    tried_with = 0
    while waiting and tried_with < len(newest):
        tried_with = len(newest)
        for name, part in list(waiting.items()):
            try:
                building = merge(building, part, config).building
            except WayfiError as error:
                left_out[name] = str(error)
                continue
            newest[name] = len(building.keyframes) - 1
            del waiting[name]
            left_out.pop(name, None)
    places = {name: _place(parts[name], building, k) for name, k in newest.items()}
    first = len(parts[root].keyframes)
    return CommonMap(pruned(building, config.pruning, config.lidar.visibility, config.map, first), places, left_out)


def _place(part: BuildingMap, joined: BuildingMap, newest: int) -> Pose2:
    """Where the frame of a part lies in the joined map, by the newest keyframe of the part: number `newest` there."""
    return Pose2.of(joined.poses[newest]) @ Pose2.of(part.poses[-1]).inverse()
