"""Files in numbered parts: blackbox_0001.mcap, blackbox_0002.mcap, ...; the oldest may have been deleted."""

from pathlib import Path

BLACKBOX = ("blackbox", ".mcap")
SESSION = ("session", ".rrd")
Kind = tuple[str, str]


def parts_of(folder: Path, kind: Kind) -> list[Path]:
    """The parts of `kind` in `folder`, oldest first."""
    stem, suffix = kind
    return sorted(folder.glob(f"{stem}_*{suffix}"), key=lambda path: (len(path.name), path.name))


def begins_at_first(folder: Path, kind: Kind) -> bool:
    """Whether the first part of `kind` has not been deleted; True if there are no parts."""
    parts = parts_of(folder, kind)
    return not parts or parts[0] == _part(folder, kind, 1)


def next_part(folder: Path, kind: Kind) -> Path:
    """The path of the part after the newest."""
    stem, _ = kind
    numbers = [path.stem.removeprefix(f"{stem}_") for path in parts_of(folder, kind)]
    newest = max((int(number) for number in numbers if number.isdecimal()), default=0)
    return _part(folder, kind, newest + 1)


def _part(folder: Path, kind: Kind, number: int) -> Path:
    stem, suffix = kind
    return folder / f"{stem}_{number:04d}{suffix}"
