"""`wayfi merge`: two saved maps of one building made one."""

from dataclasses import dataclass
from pathlib import Path

from wayfi.frontends.merging.merging import Merged, MergeError, merge
from wayfi.recordings.map.loading import load_map
from wayfi.recordings.map.manifest import MapName
from wayfi.recordings.map.saving import save_map
from wayfi.service.config import Config


@dataclass(frozen=True, slots=True, eq=False)
class MergedMaps:
    """The joined map, by its name, and what it rests on."""

    name: MapName
    merged: Merged
    warnings: tuple[str, ...]


def merge_maps(path_a: Path, path_b: Path, out: Path, config: Config) -> MergedMaps:
    """Join the maps at two paths, and save the result into `out` as a new map. Raises MapError or MergeError."""
    a, b = load_map(path_a), load_map(path_b)
    if a.map_id == b.map_id:
        raise MergeError(f"{path_b}: is of the same map as {path_a} (map_id {a.map_id}): there is nothing to merge")
    if out.resolve() in (a.folder.resolve(), b.folder.resolve()):
        raise MergeError(f"{out}: is one of the two maps; name another folder for the result")
    merged = merge(a.building, b.building, config)
    return MergedMaps(save_map(out, merged.building, config.map), merged, (*a.warnings, *b.warnings))
