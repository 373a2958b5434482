"""manifest.json: what a saved map is, and the checksum of each of its files."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from wayfi.recordings.files.map_folder import MANIFEST, MapError
from wayfi.recordings.files.replaced_together import current, read_current

FORMAT, VERSION = "wayfi-map", 2
GRAPH_ALONE = 1  # the version whose folder held graph.g2o and nothing else


@dataclass(frozen=True, slots=True)
class Checksum:
    """The SHA-256 of a file's bytes in hexadecimal, and how many they are."""

    sha256: str
    size: int

    def differs(self, data: bytes) -> str:
        """What is wrong with the bytes that were read; empty where nothing is."""
        if len(data) != self.size:
            return f"has {len(data)} bytes of {self.size}"
        return "" if checksum_of(data).sha256 == self.sha256 else "was changed since it was written"


@dataclass(frozen=True, slots=True)
class MapName:
    """The name of a saved map: `map_id` stays as it goes on, `map_version` counts what was saved of it from 1.

    `aligned` is where the frame of its first drive lies in that of a floor plan, x, y (m) and theta (rad), if the map
    was put onto one.
    """

    map_id: str
    map_version: int
    aligned: tuple[float, float, float] | None = None


@dataclass(frozen=True, slots=True)
class Manifest:
    """What a saved map is.

    `map_id` stays as the map goes on, `map_version` counts what was saved of it from 1. `created` is the stamp of the
    newest keyframe as UTC. `frames` names the frames of `map` and the robot's base, `floors` numbers the floors, and
    `counts` tells how many of what there are; `aligned` is as in MapName.
    """

    map_id: str
    map_version: int
    created: str
    wayfi: str
    frames: Mapping[str, str]
    floors: tuple[int, ...]
    counts: Mapping[str, int]
    files: Mapping[str, Checksum]
    aligned: tuple[float, float, float] | None = None

    @property
    def name(self) -> MapName:
        """The name of the map, for the one that goes on from it."""
        return MapName(self.map_id, self.map_version, self.aligned)


def checksum_of(data: bytes) -> Checksum:
    """The checksum of a file of these bytes."""
    return Checksum(hashlib.sha256(data).hexdigest(), len(data))


def manifest_text(manifest: Manifest) -> str:
    """The text of manifest.json; its last entry is the checksum of the others."""
    content = {"format": FORMAT, "version": VERSION} | asdict(manifest)
    return json.dumps(content | {"sha256": _own_sha256(content)}, indent=1) + "\n"


def read_manifest(folder: Path) -> Manifest:
    """The manifest of the map in `folder`. Raises MapError where there is no whole one, or it is of another version."""
    path = current(folder, MANIFEST)
    try:
        content = json.loads(read_current(folder, MANIFEST))
    except FileNotFoundError:
        raise MapError(f"{folder}: holds no map: there is no {MANIFEST}") from None
    except OSError as error:
        raise MapError(f"{path}: cannot be read: {error.strerror}") from None
    except (ValueError, RecursionError):
        raise MapError(f"{path}: is damaged: it is no JSON; take the map from a backup, or replay again") from None
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        raise MapError(f"{path}: is not the manifest of a map of wayfi")
    return _parse(path, content)


def _parse(path: Path, content: dict[str, Any]) -> Manifest:
    _refuse_other_versions(path, content.pop("version", None), content)
    try:
        files = {str(name): Checksum(str(f["sha256"]), int(f["size"])) for name, f in content["files"].items()}
        return Manifest(
            str(content["map_id"]), int(content["map_version"]), str(content["created"]), str(content["wayfi"]),
            dict(content["frames"]), tuple(map(int, content["floors"])), dict(content["counts"]), files,
            _aligned(content.get("aligned")),
        )  # fmt: skip
    except (KeyError, TypeError, ValueError, AttributeError, OverflowError) as error:
        raise MapError(f"{path}: is not the manifest of a map of wayfi: {error!r}") from None


def _aligned(found: Any) -> tuple[float, float, float] | None:  # noqa: ANN401 - of JSON
    if found is None:
        return None
    x, y, theta = map(float, found)
    return x, y, theta


def _refuse_other_versions(path: Path, version: Any, content: dict[str, Any]) -> None:  # noqa: ANN401 - of JSON
    """Raise MapError for a version that this wayfi does not load, or a manifest that was changed."""
    if version == GRAPH_ALONE:
        raise MapError(f"{path}: of version 1 holds the graph alone, which is no map to load: replay its drive again")
    if isinstance(version, int) and version > VERSION:
        raise MapError(
            f"{path}: is of version {version}, this wayfi loads up to version {VERSION}: install a newer one"
        )
    own = content.pop("sha256", None)
    if own != _own_sha256({"format": content.pop("format"), "version": version} | content):
        raise MapError(f"{path}: is damaged: it was changed since it was written; take the map from a backup")


def _own_sha256(content: Mapping[str, Any]) -> str:
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()
