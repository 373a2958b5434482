"""The directory of a merging daemon: robots/ROBOT/RUN holds a copy of a robot's map, map the common one.

What has been joined once and for all is in `settled`; of its copies the manifest alone is kept. One that was damaged is
in `settled.damaged`.
"""

from collections.abc import Iterator
from pathlib import Path
from urllib.parse import quote, unquote

from wayfi.recordings.files.map_folder import MANIFEST
from wayfi.recordings.files.replaced_together import current

ROBOTS, MAP, CONFIG = "robots", "map", "config.toml"
SETTLED, SET_ASIDE = "settled", "settled.damaged"
UNNAMED = "(no prefix)"  # of a robot; no encoded name has a space


def robot_folder(directory: Path, robot: str, run: str) -> Path:
    """The folder of the copy of a map; the prefix of the robot, which may have slashes, is percent-encoded."""
    return directory / ROBOTS / (_encoded(robot) or UNNAMED) / _encoded(run)


def mirrored(directory: Path) -> Iterator[tuple[str, str, Path]]:
    """The robot, the run and the folder of each map that is there, in the order of their names."""
    for folder in sorted((directory / ROBOTS).glob("*/*")):
        if current(folder, MANIFEST).exists():
            robot = folder.parent.name
            yield "" if robot == UNNAMED else unquote(robot), unquote(folder.name), folder


def _encoded(name: str) -> str:
    """A name that leads nowhere else as a path: dots are encoded too."""
    return quote(name, safe="").replace(".", "%2E")
