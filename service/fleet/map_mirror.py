"""Keeps a copy of a map that another program serves: fetches what has changed, and replaces the copy at once."""

import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import zenoh

from wayfi.backend.errors import WayfiError
from wayfi.recordings.files.map_folder import MANIFEST, PART, WHOLE_FILES, MapError, locked, replace_map
from wayfi.recordings.map.manifest import Checksum, Manifest, MapName, checksum_of, read_manifest
from wayfi.recordings.map.saving import STAGED, name_of_map

PATIENCE_S = 5.0  # for a file of a megabyte over a poor link


class FetchError(WayfiError):
    """A map that could not be fetched whole; what was fetched of it is kept for the next time."""


def found(session: zenoh.Session, pattern: str) -> Iterator[tuple[str, bytes]]:
    """The key and the bytes of each answer to a query of `pattern`."""
    everything = zenoh.ConsolidationMode.NONE
    for reply in session.get(pattern, timeout=PATIENCE_S, consolidation=everything):
        if reply.ok is not None:
            yield str(reply.ok.key_expr), reply.ok.payload.to_bytes()


def mirror(
    session: zenoh.Session, key: str, manifest: bytes, folder: Path, alive: Callable[[], None] = lambda: None
) -> MapName | None:
    """Make `folder` a copy of the map served below `key`, whose manifest is known; returns its name.

    `alive` is called before each file. None where the copy is of this version already. Raises FetchError where the link
    breaks or the map is saved anew meanwhile, MapError where what is served is no map of this version of wayfi, or
    cannot be written.
    """
    try:
        with locked(folder):
            return _mirror(session, key, manifest, folder, alive)
    except OSError as error:
        raise MapError(f"{error.filename or folder}: cannot be written: {error.strerror}") from None


def _mirror(
    session: zenoh.Session, key: str, manifest: bytes, folder: Path, alive: Callable[[], None]
) -> MapName | None:
    staged = folder / STAGED
    staged.mkdir(exist_ok=True)
    (staged / MANIFEST).write_bytes(manifest)
    wanted = read_manifest(staged)
    _refuse_foreign_files(wanted, key)
    kept = read_manifest(folder) if name_of_map(folder) else None
    if kept is not None and (kept.name, kept.files) == (wanted.name, wanted.files):
        shutil.rmtree(staged)
        return None
    there = {name: checksum for name, checksum in kept.files.items() if (folder / name).exists()} if kept else {}
    missing = {name: checksum for name, checksum in wanted.files.items() if there.get(name) != checksum}
    _forget_others(staged, missing, wanted)
    for name, checksum in missing.items():
        alive()
        if not (staged / name).exists():
            (staged / name).write_bytes(_fetched(session, f"{key}/{name}", checksum))
    replace_map(staged, folder, wanted.files)
    return wanted.name


def _refuse_foreign_files(manifest: Manifest, key: str) -> None:
    """Raise MapError for the name of a file that no map has: it might lead out of the folder."""
    for name in manifest.files:
        if name not in WHOLE_FILES and not PART.fullmatch(name):
            raise MapError(f"{key}: names a file that is of no map: {name[:80]!r}")


def _forget_others(staged: Path, missing: dict[str, Checksum], wanted: Manifest) -> None:
    """Delete what an earlier attempt fetched, unless it is of this version of the map, whole."""
    for path in staged.iterdir():
        if path.name == MANIFEST:
            continue
        if path.name not in missing or checksum_of(path.read_bytes()) != wanted.files[path.name]:
            path.unlink()


def _fetched(session: zenoh.Session, key: str, checksum: Checksum) -> bytes:
    wrong = "nobody answers"
    for _, data in found(session, key):
        wrong = checksum.differs(data)
        if not wrong:
            return data
    raise FetchError(f"{key}: {wrong}")
