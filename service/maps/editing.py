"""`wayfi closures`: the closures of a saved map, taken out or put back."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from wayfi.frontends.maps.editing import ListedClosure, edit, listed_closures
from wayfi.recordings.map.loading import load_map
from wayfi.recordings.map.manifest import MapName
from wayfi.service.config import Config
from wayfi.service.maps.saved_maps import optimising, save_edited


@dataclass(frozen=True, slots=True, eq=False)
class Closures:
    """The closures of a map, by its name; `moved_m` is how far the furthest keyframe has moved by an edit."""

    name: MapName
    closures: list[ListedClosure]
    warnings: tuple[str, ...]
    moved_m: float = 0.0


def closures(path: Path, veto: Sequence[int], restore: Sequence[int], config: Config) -> Closures:
    """The closures of the map at `path`, after those edits, which are saved as its next version.

    Raises MapError, EditError or OptimisingError; then the map stays as it was.
    """
    loaded = load_map(path)
    if not veto and not restore:
        return Closures(loaded.name, listed_closures(loaded.building), loaded.warnings)
    edited = edit(loaded.building, optimising(config), veto, restore)
    name = save_edited(loaded, edited, config)
    moved = edited.poses[:, :2] - loaded.building.poses[:, :2]
    moved_m = float((moved**2).sum(axis=1).max() ** 0.5)
    return Closures(name, listed_closures(edited), loaded.warnings, moved_m)
