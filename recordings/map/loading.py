"""Loading a saved map: every file is verified, and what is lost is made up for as far as that goes."""

import os
from dataclasses import dataclass
from pathlib import Path

import pyarrow as pa

from wayfi.backend.graph.factors import Factor
from wayfi.backend.grid.map_config import MapConfig
from wayfi.backend.grid.occupancy_grid import OccupancyGrid
from wayfi.backend.pose2 import Floats
from wayfi.frontends.calibration import Calibration
from wayfi.frontends.event_making import NO_HITS
from wayfi.frontends.maps.building_map import BuildingMap, MapFingerprint, MapKeyframe
from wayfi.frontends.maps.optimising import drawn
from wayfi.recordings.files.calibration_file import parse_calibration
from wayfi.recordings.files.map_files import GRID_FILES, of_floor
from wayfi.recordings.files.map_folder import (
    ACCESS_POINTS,
    CALIBRATION,
    EXPORTS,
    GRID,
    KEYFRAMES,
    MANIFEST,
    MapError,
)
from wayfi.recordings.files.replaced_together import current
from wayfi.recordings.map.closure_table import KeptClosure
from wayfi.recordings.map.columns import read_parquet
from wayfi.recordings.map.fingerprint_table import read_weights
from wayfi.recordings.map.grid_table import read_grid
from wayfi.recordings.map.keyframe_table import KeptKeyframes, read_keyframes
from wayfi.recordings.map.manifest import Manifest, MapName, read_manifest
from wayfi.recordings.map.parts import CLOSURES, FACTORS, FINGERPRINTS, SCANS, PartedTable
from wayfi.recordings.map.recovery import bridged, calibration_of, renumbered
from wayfi.recordings.map.verified_files import VerifiedFiles

ATTEMPTS = 3  # a map that is being saved while it is loaded is loaded again
NO_SCAN = (None, NO_HITS)


@dataclass(frozen=True, slots=True, eq=False)
class LoadedMap:
    """A map that was loaded from `folder`; each of the `warnings` tells what was damaged in it, and what follows."""

    building: BuildingMap
    folder: Path
    manifest: Manifest
    warnings: tuple[str, ...]

    @property
    def name(self) -> MapName:
        """The id and version of the map, for the one that goes on from it."""
        return self.manifest.name

    @property
    def map_id(self) -> str:
        """The id of the map, which stays as it goes on."""
        return self.manifest.map_id

    @property
    def map_version(self) -> int:
        """How many times the map has been saved."""
        return self.manifest.map_version


def load_map(path: str | os.PathLike[str]) -> LoadedMap:
    """Load the map in the folder `path`, or in `map` of the results there.

    Every file is verified; what is damaged or missing is left out or made up for, with a warning. Raises MapError where
    there is no map, its keyframes are damaged, or a newer wayfi has written it.
    """
    folder = map_folder(Path(path))
    for _ in range(ATTEMPTS):
        manifest = read_manifest(folder)
        loading = _Loading(folder, manifest)
        building = loading.building()
        if (building is not None and not loading.warnings) or manifest == read_manifest(folder):
            break
    pa.default_memory_pool().release_unused()  # what the tables took to read: a fifth of what the map takes
    if building is None:
        raise MapError(f"{folder / KEYFRAMES}: {loading.damaged[KEYFRAMES]}: without it there is no map; take another")
    return LoadedMap(building, folder, manifest, tuple(loading.warnings))


def map_folder(path: Path) -> Path:
    """The folder of the map that `path` means: itself, or `map` of the results there."""
    return path if current(path, MANIFEST).exists() or not (path / "map").is_dir() else path / "map"


class _Loading:
    """One attempt to load a map."""

    def __init__(self, folder: Path, manifest: Manifest) -> None:
        self._folder, self._files = folder, VerifiedFiles(folder, manifest)
        self.warnings: list[str] = []

    @property
    def damaged(self) -> dict[str, str]:
        """What is wrong with each file that is damaged."""
        return self._files.damaged

    def building(self) -> BuildingMap | None:
        """The map, as far as it is whole; None where its keyframes are not."""
        kept = self._files.read(KEYFRAMES, lambda data: read_keyframes(read_parquet(data)))
        if kept is None:
            return None
        keyframes = self._keyframes(kept)
        closures = self._closures()
        exports = {of_floor(name, floor) for floor in set(kept.floors) for name in GRID_FILES}
        for name in sorted(exports & self._files.names | set(EXPORTS)):
            if self._files.verify(name) is None:
                self._warn(name, "other programs cannot open it; the next save writes it again")
        return BuildingMap(
            keyframes, kept.poses, kept.calibrations, self._factors(kept.poses), [closure for closure, _ in closures],
            self._fingerprints(), self._weights(), self._calibration(kept.calibrations),
            self._grids(keyframes, kept.poses), kept.pieces,
            frozenset(k for k, (_, vetoed) in enumerate(closures) if vetoed),
        )  # fmt: skip

    def _keyframes(self, kept: KeptKeyframes) -> list[MapKeyframe]:
        scans, damaged = self._files.rows(SCANS)
        self._warn_of_parts(SCANS, damaged, "keyframes", "have no scan: nothing is matched with them")
        rows = zip(kept.stamps_ns, kept.paths_m, kept.sessions, kept.floors, strict=True)
        return [
            MapKeyframe(stamp_ns, path_m, scan, hits, session, floor)
            for k, (stamp_ns, path_m, session, floor) in enumerate(rows)
            for scan, hits in [scans.get(k, NO_SCAN)]
        ]

    def _factors(self, poses: Floats) -> dict[int, Factor]:
        factors, damaged = self._files.rows(FACTORS)
        self._warn_of_parts(FACTORS, damaged, "factors", "are lost: the steps among them are made of the poses")
        return bridged(factors, poses) if damaged else factors

    def _closures(self) -> list[KeptClosure]:
        closures, damaged = self._files.rows(CLOSURES)
        self._warn_of_parts(CLOSURES, damaged, "closures", "are lost, with their vetoes: their factors stay")
        return renumbered(closures.values()) if damaged else list(closures.values())

    def _fingerprints(self) -> list[MapFingerprint]:
        fingerprints, damaged = self._files.rows(FINGERPRINTS)
        self._warn_of_parts(FINGERPRINTS, damaged, "fingerprints", "are lost: WiFi does not know their places")
        return list(fingerprints.values())

    def _weights(self) -> dict[str, float]:
        weights = self._files.read(ACCESS_POINTS, lambda data: read_weights(read_parquet(data)))
        if weights is None:
            self._warn(ACCESS_POINTS, "every access point counts the same")
        return weights or {}

    def _calibration(self, calibrations: Floats) -> Calibration:
        where = str(self._folder / CALIBRATION)
        found = self._files.read(CALIBRATION, lambda data: parse_calibration(data.decode(), where))
        if found is None:
            self._warn(CALIBRATION, "the wheels are as at the newest keyframe, the receivers are unknown")
        return found or calibration_of(calibrations)

    def _grids(self, keyframes: list[MapKeyframe], poses: Floats) -> dict[int, OccupancyGrid]:
        floors = {0, *(keyframe.floor for keyframe in keyframes)}
        names = {floor: of_floor(GRID, floor) for floor in sorted(floors)}
        if names.keys() != {0} and not self._files.names & set(names.values()) - {GRID}:
            names = {0: GRID}  # saved when all floors were drawn into one grid: that one stays as it was
        grids = {floor: self._files.read(name, _parse_grid) for floor, name in names.items()}
        read = {floor: grid for floor, grid in grids.items() if grid is not None}
        for floor in grids.keys() - read.keys():
            self._warn(names[floor], "the grid is drawn again from the scans")
        return read if read.keys() == floors else drawn(keyframes, poses, MapConfig()) | read

    def _warn(self, name: str, follows: str) -> None:
        self.warnings.append(f"{self._folder / name}: {self.damaged[name]}: {follows}")

    def _warn_of_parts(self, table: PartedTable, damaged: list[str], rows: str, follow: str) -> None:
        for name in damaged:
            first = (table.part_of(name) or 0) * table.rows
            self._warn(name, f"{rows} {first} to {first + table.rows - 1} {follow}")


def _parse_grid(data: bytes) -> OccupancyGrid:
    return read_grid(read_parquet(data))
