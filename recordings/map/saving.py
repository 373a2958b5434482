"""Saving a map: the files that changed are written beside the former ones, and take their place at once."""

import hashlib
import shutil
from collections.abc import Iterator, Mapping
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path

from wayfi.backend.grid.map_config import MapConfig
from wayfi.frontends.frames.frames_config import FramesConfig
from wayfi.frontends.maps.building_map import BuildingMap
from wayfi.frontends.maps.optimising import factors_in_force
from wayfi.recordings.files.calibration_file import calibration_toml
from wayfi.recordings.files.g2o import g2o_text
from wayfi.recordings.files.map_files import grid_files, of_floor
from wayfi.recordings.files.map_folder import (
    ACCESS_POINTS,
    CALIBRATION,
    GRAPH,
    GRID,
    KEYFRAMES,
    MANIFEST,
    MapError,
    locked,
    replace_map,
)
from wayfi.recordings.map.columns import utc
from wayfi.recordings.map.fingerprint_table import access_point_table
from wayfi.recordings.map.grid_table import grid_table
from wayfi.recordings.map.keyframe_table import keyframe_table
from wayfi.recordings.map.manifest import Checksum, Manifest, MapName, checksum_of, manifest_text, read_manifest
from wayfi.recordings.map.parts import TABLES, Made, same

STAGED = ".staged"


def save_map(
    folder: Path, building: BuildingMap, config: MapConfig | None = None, former: MapName | None = None
) -> MapName:
    """Save a map into `folder`, made if need be, in place of the one there; returns its name.

    `former` is the name of the map that this one goes on from: it keeps the id and gets the next version; without, the
    id is a hash of what is saved. Files of the user in `folder` stay. Whatever becomes of the process, `folder` holds
    the former map or the new one, whole. Raises MapError where it cannot be written.
    """
    return MapSaver(folder, config, former).save(building)


def name_of_map(folder: Path) -> MapName | None:
    """The name of the map in `folder`; None where there is none that can be told of."""
    try:
        return read_manifest(folder).name
    except MapError:
        return None


class MapSaver:
    """Saves a map as it grows: only the parts of its tables that have changed since are written.

    It knows by their identity which scans, factors and readings it has saved: they are never changed.
    """

    def __init__(
        self,
        folder: Path,
        config: MapConfig | None = None,
        former: MapName | None = None,
        frames: FramesConfig | None = None,
    ) -> None:
        self._folder, self._config, self._name = folder, config or MapConfig(), former
        self._frames = frames or FramesConfig()
        self._made: dict[str, list[Made]] = {}
        self._files: dict[str, Checksum] = {}  # of `_folder`, as saved by this object last

    def save(self, building: BuildingMap) -> MapName:
        """Save a map as `save_map` does."""
        try:
            with locked(self._folder):
                return self._save(building)
        except OSError as error:
            raise MapError(f"{error.filename or self._folder}: cannot be written: {error.strerror}") from None

    def _save(self, building: BuildingMap) -> MapName:
        self._take_note_of_others()
        staged = self._folder / STAGED
        shutil.rmtree(staged, ignore_errors=True)
        staged.mkdir()
        files = dict(self._files)
        made = dict(self._write_parts(staged, building, files))
        whole = dict(_whole_files(building, self._config))
        for name, data in whole.items():
            files[name] = _write(staged / name, data)
        for name in files.keys() - made.keys() - whole.keys():
            del files[name]
        former = self._name
        named = replace(former, map_version=former.map_version + 1) if former else MapName(_id_of(files), 1)
        _write(staged / MANIFEST, manifest_text(_manifest(named, building, files, self._frames)).encode())
        replace_map(staged, self._folder, files)
        self._made, self._files, self._name = made, files, named
        return named

    def _take_note_of_others(self) -> None:
        """Where the folder is not as this object left it, all is written anew, as the version after that there."""
        try:
            found = read_manifest(self._folder)
        except MapError:
            found = None
        if self._files and (found is None or found.files != self._files):
            self._made, self._files = {}, {}
        if found and self._name and found.map_id == self._name.map_id:
            later = max(found.map_version, self._name.map_version)
            self._name = replace(self._name, map_version=later)

    def _write_parts(
        self, staged: Path, building: BuildingMap, files: dict[str, Checksum]
    ) -> Iterator[tuple[str, list[Made]]]:
        """Write the parts that have changed, with their checksums in `files`; yields what each part is made of."""
        for table in TABLES:
            for part, rows in table.parts(building).items():
                name, numbers = table.file(part), list(rows)
                made = [(number, *table.made_of(row)) for number, row in rows.items()]
                if not same(made, self._made.get(name, [])):
                    files[name] = _write(staged / name, table.write(numbers, list(rows.values())))
                yield name, made


def _whole_files(building: BuildingMap, config: MapConfig) -> Iterator[tuple[str, bytes]]:
    """The files that are written anew by every save: they are small, or all of them changes."""
    yield KEYFRAMES, keyframe_table(building)
    yield ACCESS_POINTS, access_point_table(building.weights)
    yield CALIBRATION, calibration_toml(building.calibration).encode()
    yield GRAPH, g2o_text(building.poses, factors_in_force(building), building.calibration.wheels.values).encode()
    for floor, grid in building.grids.items():
        yield of_floor(GRID, floor), grid_table(grid)
        yield from grid_files(grid, config, floor).items()


def _manifest(named: MapName, building: BuildingMap, files: Mapping[str, Checksum], frames: FramesConfig) -> Manifest:
    keyframes = building.keyframes
    return Manifest(
        named.map_id,
        named.map_version,
        created=utc(max((keyframe.stamp_ns for keyframe in keyframes), default=0)),
        wayfi=version("wayfi"),
        frames={"map": frames.map, "base": frames.base_link},
        floors=tuple(sorted({keyframe.floor for keyframe in keyframes})),
        counts={
            "keyframes": len(keyframes),
            "factors": len(building.factors),
            "closures": len(building.closures),
            "fingerprints": len(building.fingerprints),
            "access_points": len(building.weights),
            "sessions": len({keyframe.session for keyframe in keyframes}),
        },
        files=dict(sorted(files.items())),
        aligned=named.aligned,
    )


def _id_of(files: Mapping[str, Checksum]) -> str:
    """The id of a new map: 32 hexadecimal digits that hash what is saved first of it."""
    return hashlib.sha256("".join(files[name].sha256 for name in sorted(files)).encode()).hexdigest()[:32]


def _write(path: Path, data: bytes) -> Checksum:
    path.write_bytes(data)
    return checksum_of(data)
