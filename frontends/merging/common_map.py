"""The one map of several drives in one building: each is joined to the others where that is certain."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.maps.building_map import BuildingMap, MapKeyframe
from wayfi.frontends.maps.pruning import pruned
from wayfi.frontends.merging.merging import merge, place_of
from wayfi.frontends.slam_config import SlamConfig


@dataclass(frozen=True, slots=True, eq=False)
class CommonMap:
    """The joined map, and by the name of each part the poses (n, 3) of its keyframes in it, or why it is left out.

    `places` tells T_common_map of each part, as its keyframes fit best, `sessions` the numbers that its sessions have.
    """

    building: BuildingMap
    poses: Mapping[str, Floats]
    places: Mapping[str, Pose2]
    sessions: Mapping[str, range]
    left_out: Mapping[str, str]


def common_map(parts: Mapping[str, BuildingMap], config: SlamConfig) -> CommonMap:
    """Join the maps of `parts`, which are not empty, in the frame of the first.

    One that does not join is tried again when another has: it may overlap with that one alone. What several parts have
    seen is kept once.
    """
    (root, building), *others = parts.items()
    begins = {root: 0}
    waiting, left_out = dict(others), dict[str, str]()
    tried_with = 0
    while waiting and tried_with < len(begins):
        tried_with = len(begins)
        for name, part in list(waiting.items()):
            before = len(building.keyframes)
            try:
                building = merge(building, part, config).building
            except Exception as error:  # whatever is wrong with one robot's map, the others are joined
                left_out[name] = str(error) or repr(error)
                continue
            begins[name] = before
            del waiting[name]
            left_out.pop(name, None)
    poses = {name: building.poses[k : k + len(parts[name].keyframes)] for name, k in begins.items()}
    places = {name: place_of(parts[name].poses, joined) for name, joined in poses.items()}
    sessions = {name: _sessions(building.keyframes[k : k + len(poses[name])]) for name, k in begins.items()}
    first = len(parts[root].keyframes)
    kept = pruned(building, config.pruning, config.lidar.visibility, config.map, first)
    return CommonMap(kept, poses, places, sessions, left_out)


def _sessions(keyframes: Sequence[MapKeyframe]) -> range:
    numbers = [keyframe.session for keyframe in keyframes]
    return range(min(numbers), max(numbers) + 1)
