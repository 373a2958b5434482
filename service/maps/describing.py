"""What a saved map holds, in numbers and in words."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wayfi.frontends.events import Verdict
from wayfi.frontends.maps.building_map import BuildingMap
from wayfi.recordings.files.map_folder import MANIFEST, files_of_a_map
from wayfi.recordings.files.replaced_together import current
from wayfi.recordings.map.loading import load_map, map_folder
from wayfi.recordings.map.manifest import VERSION

RECORDED = ("*.mcap", "*.db3", "*.bag", "metadata.yaml")  # in the folder of a recording


@dataclass(frozen=True, slots=True)
class MapDescription:
    """What a saved map holds: `area_m2` is of the cells that are known, `path_m` what was driven between keyframes.

    `vetoed` counts closures that were taken out by hand, `warnings` tell what is damaged, and what follows.
    """

    map: str
    map_id: str
    map_version: int
    format_version: int
    created: str
    wayfi: str
    size_bytes: int
    keyframes: int
    scans: int
    sessions: int
    floors: tuple[int, ...]
    path_m: float
    area_m2: float
    factors: int
    closures: int
    vetoed: int
    fingerprints: int
    access_points: int
    aligned: tuple[float, float, float] | None
    warnings: tuple[str, ...]

    @property
    def whole(self) -> bool:
        """Whether nothing of it is damaged."""
        return not self.warnings


def is_map(path: Path) -> bool:
    """Whether `path` is the folder of a saved map, or of results with one, rather than a recording."""
    recorded = any(next(path.glob(name), None) for name in RECORDED)
    return path.is_dir() and not recorded and current(map_folder(path), MANIFEST).exists()


def describe(path: Path) -> MapDescription:
    """What the map in `path`, or in `map` of the results there, holds. Raises MapError where it cannot be loaded."""
    loaded = load_map(path)
    building, manifest, folder = loaded.building, loaded.manifest, loaded.folder
    accepted = [k for k, c in enumerate(building.closures) if c.judged.verdict is Verdict.ACCEPTED]
    places = [current(folder, file.name) for file in files_of_a_map(folder)]
    return MapDescription(
        map=str(folder),
        map_id=manifest.map_id,
        map_version=manifest.map_version,
        format_version=VERSION,
        created=manifest.created,
        wayfi=manifest.wayfi,
        size_bytes=sum(place.stat().st_size for place in places),
        keyframes=len(building.keyframes),
        scans=sum(keyframe.scan is not None for keyframe in building.keyframes),
        sessions=len({keyframe.session for keyframe in building.keyframes}),
        floors=manifest.floors,
        path_m=_driven_m(building),
        area_m2=sum(float(np.count_nonzero(g.evidence)) * g.resolution_m**2 for g in building.grids.values()),
        factors=len(building.factors),
        closures=len(set(accepted) - building.vetoed),
        vetoed=len(building.vetoed),
        fingerprints=len(building.fingerprints),
        access_points=len({bssid for f in building.fingerprints for bssid in f.readings.bssids}),
        aligned=manifest.aligned,
        warnings=loaded.warnings,
    )


def words_of(found: MapDescription) -> list[str]:
    """The description as lines."""
    floors = f"floor {found.floors[0]}" if len(found.floors) == 1 else f"floors {', '.join(map(str, found.floors))}"
    plan = "put onto a floor plan" if found.aligned else "in the frame of its first drive"
    return [
        f"{found.map}: map {found.map_id}, version {found.map_version}, {plan}",
        f"saved at {found.created} of the robot's clock by wayfi {found.wayfi}, format {found.format_version}",
        f"{found.area_m2:.0f} m2 seen on {floors}; {found.path_m:.0f} m driven in {_many(found.sessions, 'session')}",
        f"{_many(found.keyframes, 'keyframe')}, {found.scans} with a scan; {_many(found.factors, 'factor')}",
        f"{_many(found.closures, 'closure')}, {found.vetoed} more vetoed by hand",
        f"{_many(found.fingerprints, 'fingerprint')} of {_many(found.access_points, 'access point')}",
        f"{found.size_bytes / 1e6:.1f} MB, {'whole' if found.whole else 'damaged:'}",
        *(f"! {warning}" for warning in found.warnings),
    ]


def _driven_m(building: BuildingMap) -> float:
    """How far apart the keyframes of each session lie along its path, in all."""
    paths: dict[int, list[float]] = {}
    for keyframe in building.keyframes:
        paths.setdefault(keyframe.session, []).append(keyframe.path_m)
    return sum(max(path_m) - min(path_m) for path_m in paths.values())


def _many(count: int, thing: str) -> str:
    return f"{count} {thing}" if count == 1 else f"{count} {thing}s"
