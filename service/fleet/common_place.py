"""A robot in its fleet: keeps a copy of the common map in its run's folder, and knows where its own map lies in it."""

import threading
from pathlib import Path

import zenoh

from wayfi.backend.pose2 import Pose2
from wayfi.recordings.closing import Closing
from wayfi.recordings.files.map_folder import MANIFEST
from wayfi.recordings.map.manifest import MapName
from wayfi.recordings.map.saving import name_of_map
from wayfi.service.config import Config
from wayfi.service.fleet.fleet_file import FLEET, Fleet, parse_fleet
from wayfi.service.fleet.grid_message import grid_message
from wayfi.service.fleet.keys import COMMON, everywhere
from wayfi.service.fleet.map_mirror import found, mirror
from wayfi.service.process.log_lines import LogLines
from wayfi.service.transport.publishers import Publishers

FOLDER = "common_map"  # in the run's folder
CLOSE_S = 1.0  # for a look that is under way; it ends with the session otherwise


class CommonPlace(Closing):
    """Looks every `fleet_every_s` for the common map that a merging daemon serves; a context manager.

    Where that has joined this run's map, or is the map `known` that the run localises in, poses are published in it as
    well. What is known stays, however long no merging daemon answers.
    """

    def __init__(
        self,
        session: zenoh.Session,
        config: Config,
        run: Path,
        publishers: Publishers,
        log: LogLines,
        known_id: str = "",
    ) -> None:
        self._session, self._config = session, config.zenoh
        self._map, self._frames = config.map, config.frames
        self._run, self._known_id = run, known_id
        self._publishers = publishers
        self._log = log
        self._published: MapName | None = None
        self._told = ""
        self._closed = threading.Event()
        self._thread = threading.Thread(target=self._look_again, name="common map", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Look no more."""
        self._closed.set()
        self._thread.join(CLOSE_S)

    def _look_again(self) -> None:
        while not self._closed.wait(self._config.fleet_every_s):
            try:
                self._look()
            except Exception as error:  # what others send, and any disk, may be at fault: the next look may succeed
                self._tell(str(error) or repr(error))

    def _look(self) -> None:
        for key, data in found(self._session, everywhere(COMMON, FLEET)):
            self._copy(key.removesuffix(f"/{FLEET}"))
            self._take_place(parse_fleet(data, key))

    def _take_place(self, fleet: Fleet) -> None:
        """Take over where this run's map lies; the very map that the run localises in lies at the origin."""
        place = fleet.place_of(self._config.prefix.strip("/"), self._run.name)
        if place is None and self._published is not None and self._published.map_id == self._known_id:
            place = (0.0, 0.0, 0.0)
        if place is not None:
            if self._publishers.T_common_map is None:
                self._log.info("joined", text="this run's map is part of the common one")
            self._publishers.T_common_map = Pose2(*place)

    def _copy(self, served: str) -> None:
        for _, manifest in found(self._session, f"{served}/{MANIFEST}"):
            mirror(self._session, served, manifest, self._run / FOLDER)
        name = name_of_map(self._run / FOLDER)
        if name is not None and name != self._published:
            self._publishers.publish_common_map(grid_message(self._run / FOLDER, self._map, self._frames))
            self._log.info("common map", map_id=name.map_id, map_version=name.map_version)
            self._published = name

    def _tell(self, text: str) -> None:
        """Log what went wrong, once."""
        if text != self._told and not self._closed.is_set():
            self._log.warning("common map", text=text)
        self._told = text
