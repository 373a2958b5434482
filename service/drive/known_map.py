"""The saved map that a drive localises in; its black box names it, so that a replay finds it or says what it misses."""

import hashlib
import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Self

from wayfi.frontends.maps.building_map import BuildingMap
from wayfi.recordings.files.map_folder import MANIFEST, MapError
from wayfi.recordings.files.replaced_together import current
from wayfi.recordings.map.loading import load_map, map_folder
from wayfi.recordings.map.manifest import MapName, read_manifest
from wayfi.service.drive.mode import Mode


@dataclass(frozen=True, slots=True, eq=False)
class KnownMap:
    """The map that a drive begins in, its name, and what the drive does in it."""

    building: BuildingMap
    name: MapName
    mode: Mode


@dataclass(frozen=True, slots=True)
class MapReference:
    """A saved map: the absolute path of its folder, its name, and the SHA-256 of its manifest in hexadecimal.

    The manifest holds the checksum of every other file. `mode` is what the drive does at first.
    """

    path: str
    map_id: str
    map_version: int
    sha256: str
    mode: Mode = Mode.LOCALIZATION

    @classmethod
    def of(cls, path: Path, mode: Mode = Mode.LOCALIZATION) -> Self:
        """The reference of the map in the folder `path`, or in `map` of the results there. Raises MapError."""
        folder = map_folder(path).absolute()
        manifest = read_manifest(folder)
        return cls(str(folder), manifest.map_id, manifest.map_version, _sha256_of_manifest(folder), mode)

    @classmethod
    def parse(cls, data: bytes, where: str) -> Self:
        """The reference that `to_json` made these bytes of. Raises MapError, which names `where`."""
        try:
            fields = json.loads(data)
            named = str(fields["path"]), str(fields["map_id"]), int(fields["map_version"]), str(fields["sha256"])
            return cls(*named, Mode(fields["mode"]))
        except (ValueError, KeyError, TypeError) as error:
            raise MapError(f"{where}: does not name a map: {error!r}") from None

    def to_json(self) -> str:
        """The reference as JSON."""
        return json.dumps(asdict(self), indent=1) + "\n"

    def load(self) -> KnownMap:
        """The map. Raises MapError where it is not there any more, or is another one by now."""
        folder = Path(self.path)
        try:
            changed = _sha256_of_manifest(folder) != self.sha256
        except OSError:
            changed = True
        if changed:
            raise MapError(f"{self.path}: does not hold the map {self} any more: put it back there")
        return KnownMap(load_map(folder).building, MapName(self.map_id, self.map_version), self.mode)

    def __str__(self) -> str:
        return f"{self.map_id} of version {self.map_version}"


def _sha256_of_manifest(folder: Path) -> str:
    return hashlib.sha256(current(folder, MANIFEST).read_bytes()).hexdigest()
