"""`wayfi align`: a saved map put onto a floor plan."""

from dataclasses import dataclass, replace
from pathlib import Path

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.maps.aligning import AlignError, Alignment, align, moved
from wayfi.recordings.files.tum import read_tum
from wayfi.recordings.map.loading import load_map
from wayfi.recordings.map.manifest import MapName
from wayfi.recordings.trajectory import Trajectory
from wayfi.service.config import Config
from wayfi.service.maps.saved_maps import save_edited


@dataclass(frozen=True, slots=True, eq=False)
class Aligned:
    """The map, by its name, as it was aligned by `fixes`."""

    name: MapName
    fixes: Trajectory
    alignment: Alignment
    warnings: tuple[str, ...]


def align_map(path: Path, fixes_path: Path, out: Path | None, config: Config) -> Aligned:
    """Put the map at `path` into the frame of the fixes, and save it into `out`, or in its place.

    Raises MapError, TrajectoryError or AlignError; then the map stays as it was.
    """
    loaded, fixes = load_map(path), read_tum(fixes_path)
    try:
        alignment = align(loaded.building, fixes.stamps_ns, fixes.poses)
    except AlignError as error:
        raise AlignError(f"{fixes_path}: {error}") from None
    T = alignment.T_plan_map
    before = Pose2.of(loaded.name.aligned) if loaded.name.aligned else Pose2()
    after = T @ before
    name = replace(loaded.name, aligned=(after.x, after.y, after.theta))
    saved = save_edited(loaded, moved(loaded.building, T, config.map), config, name, out)
    return Aligned(saved, fixes, alignment, loaded.warnings)
