"""Kills a daemon and measures what was lost."""

import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from live.daemons import Robot, Running
from PIL import Image

from wayfi.recordings.files.map_files import UNKNOWN
from wayfi.recordings.mcap.parts import BLACKBOX, parts_of
from wayfi.recordings.mcap.recording import open_recording

WAITING = 10  # messages, at a kill: a twelfth of a second of them at twice real time


@dataclass(frozen=True, slots=True)
class Kill:
    """When a daemon was ready and when it was killed, s, monotonic; the messages in the newest part of its black box.

    `map_cells` counts the known cells of its map, 0 without one.
    """

    ready_s: float
    killed_s: float
    messages: int
    map_cells: int

    def lost_s(self, robot: Robot, kept: set[bytes]) -> float:
        """How long before the kill the first message was put that is not in the black box, which `kept` is of."""
        heard = [at_s for at_s, data in robot.put if self.ready_s < at_s < self.killed_s and data not in kept]
        return self.killed_s - min(heard, default=self.killed_s)


def kill_after(daemon: Running, seconds: float) -> Kill:
    """Kill a daemon that is ready so long from now, and start it again."""
    ready_s = time.monotonic()
    time.sleep(seconds)
    daemon.settle(WAITING)  # what waits is not recorded yet: on a busy machine more than a kill may cost
    killed_s = daemon.kill()
    recorded = sum(1 for _ in open_recording(parts_of(daemon.folder, BLACKBOX)[-1]))
    cells = cells_of_map(daemon.folder)
    daemon.start_again()
    return Kill(ready_s, killed_s, recorded, cells)


def cells_of_map(folder: Path) -> int:
    """How many cells the map in a run's folder has that are not unknown; 0 without a map."""
    description = folder / "map.yaml"
    if not description.exists():
        return 0
    image = next(line.split()[1] for line in description.read_text().splitlines() if line.startswith("image:"))
    with Image.open(folder / image) as picture:
        return int(np.count_nonzero(np.asarray(picture) != UNKNOWN))
