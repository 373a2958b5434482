"""Loading a map that another program has made."""

from pathlib import Path

import numpy as np

from wayfi.frontends.maps.building_map import BuildingMap
from wayfi.recordings.files.map_folder import MapError
from wayfi.recordings.map.loading import LoadedMap, load_map


def load_consistent(folder: Path) -> LoadedMap:
    """The map in a folder. Raises MapError where it is damaged or contradicts itself."""
    loaded = load_map(folder)
    if not _consistent(loaded.building):
        raise MapError(f"{folder}: contradicts itself: it relates keyframes that it does not have; delete it there")
    return loaded


def _consistent(building: BuildingMap) -> bool:
    """Whether all poses are finite, and all that is related to keyframes is to keyframes of the map."""
    related = [f.keyframe for f in building.fingerprints]
    related += [k for factor in building.factors.values() for k in (factor.a, factor.b)]
    return bool(np.isfinite(building.poses).all()) and max(related, default=0) < len(building.keyframes)
