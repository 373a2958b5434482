"""`wayfi run --merge`: fetches the maps that the daemons of a fleet make, joins them, and serves the common map."""

import subprocess
import sys
import time
from contextlib import ExitStack
from pathlib import Path

import zenoh

from wayfi.backend.errors import WayfiError
from wayfi.recordings.files.map_folder import MANIFEST
from wayfi.recordings.map.saving import name_of_map
from wayfi.service.config import Config, config_toml
from wayfi.service.fleet.fleet_file import Fleet, FleetFileError, Member, read_fleet
from wayfi.service.fleet.grid_message import grid_message
from wayfi.service.fleet.keys import COMMON_MAP, KEYFRAMES, common_key, everywhere, robot_and_run
from wayfi.service.fleet.map_mirror import FetchError, found, mirror
from wayfi.service.fleet.map_server import MapServer
from wayfi.service.fleet.robot_folders import CONFIG, MAP, mirrored, robot_folder
from wayfi.service.process.log_lines import LogLines
from wayfi.service.process.service_manager import ServiceManager
from wayfi.service.process.stop_signal import StopSignal
from wayfi.service.transport.latched_publisher import LatchedPublisher
from wayfi.service.transport.latest_value import LatestValue
from wayfi.service.transport.output_messages import OK, WARN, Status, status_message
from wayfi.service.transport.publishers import ALIVE
from wayfi.service.transport.zenoh_session import key_of

IDLE_S = 0.1
RETRY_S = 60.0  # after a merging that failed: the disk was full, say


class MergingError(WayfiError):
    """A directory that the maps of a fleet cannot be kept in."""


class MergingDaemon:
    """Looks for new maps every `fleet_every_s`, and joins them, in a process of its own, where one has changed.

    What was fetched stays in `recording.directory`, also of robots that have left. A run that has ended is joined for
    good; the newest of each robot is joined to that, anew each time.
    """

    def __init__(self, config: Config, session: zenoh.Session, log: LogLines, stop: StopSignal) -> None:
        self._config, self._session = config, session
        self._log, self._stop = log, stop
        self._directory = Path(config.recording.directory)
        self._merging: subprocess.Popen[bytes] | None = None
        self._changed = any(True for _ in mirrored(self._directory))
        self._from_s = 0.0  # monotonic, before which no merging is begun
        self._told: dict[str, str] = {}
        self._manager = ServiceManager()

    def run(self) -> None:
        """Serve until a stop is requested.

        Raises MergingError where the directory cannot be written, ZenohError where a key cannot be declared.
        """
        try:
            self._directory.mkdir(parents=True, exist_ok=True)
            (self._directory / CONFIG).write_text(config_toml(self._config))
        except OSError as error:
            raise MergingError(
                f"{self._directory}: cannot be written: {error.strerror}; see recording.directory"
            ) from None
        blocking, dropping = zenoh.CongestionControl.BLOCK, zenoh.CongestionControl.DROP
        with ExitStack() as opened:
            grid = opened.enter_context(LatchedPublisher(self._session, self._key("wayfi/map"), blocking))
            self._map = opened.enter_context(LatestValue(grid.put))
            self._status = opened.enter_context(LatchedPublisher(self._session, self._key("wayfi/status"), dropping))
            folders = {COMMON_MAP: self._directory / MAP}
            opened.enter_context(MapServer(self._session, common_key(self._config.zenoh), lambda: folders, self._log))
            opened.enter_context(self._session.liveliness().declare_token(self._key(ALIVE)))
            self._publish()
            self._log.info("ready", listen=",".join(self._config.zenoh.listen), directory=self._directory)
            self._manager.ready(f"merging in {self._directory}")
            opened.callback(self._end_merging)
            self._serve()
        self._log.info("stopped", signal=self._stop.name)

    def _serve(self) -> None:
        while not self._stop.requested:
            self._look()
            until_s = time.monotonic() + self._config.zenoh.fleet_every_s
            while time.monotonic() < until_s and not self._stop.requested:
                self._manager.alive()
                self._merge()
                time.sleep(IDLE_S)
        self._manager.stopping()

    def _look(self) -> None:
        """Fetch what the robots that answer have mapped since the last time."""
        for key, manifest in found(self._session, everywhere(KEYFRAMES, MANIFEST)):
            if self._stop.requested:
                return
            robot, run = robot_and_run(key)
            folder = robot_folder(self._directory, robot, run)
            try:
                name = mirror(self._session, key.removesuffix(f"/{MANIFEST}"), manifest, folder, self._go_on)
            except Exception as error:  # whatever one robot sends, the others are fetched
                self._tell(f"{robot}/{run}", str(error) or repr(error))
                continue
            if name is not None:
                self._log.info("fetched", robot=robot, run=run, map_version=name.map_version)
                self._changed = True

    def _go_on(self) -> None:
        """Before each file: the daemon is alive, and stops where that is requested. Raises FetchError then."""
        self._manager.alive()
        if self._stop.requested:
            raise FetchError("the daemon is stopping")

    def _merge(self) -> None:
        """Start to join what has changed, or take over what was joined."""
        if self._merging is None and self._changed and time.monotonic() >= self._from_s:
            command = [sys.executable, "-m", "wayfi.service.fleet.merging_process", str(self._directory)]
            self._merging, self._changed = subprocess.Popen(command, stdin=subprocess.DEVNULL), False
        elif self._merging is not None and (code := self._merging.poll()) is not None:
            self._merging = None
            if code:
                self._log.warning("not joined", text="the common map stays as it was; see the line before")
                self._changed, self._from_s = True, time.monotonic() + RETRY_S
            self._publish()

    def _publish(self) -> None:
        """Publish the common map, if there is one, and which maps are part of it."""
        name, fleet = name_of_map(self._directory / MAP), self._fleet()
        for member in _unsettled(fleet):
            self._tell(f"{member.robot}/{member.run}", member.why or "joined")
        if name is not None:
            self._map.put(grid_message(self._directory / MAP, self._config.map, self._config.frames))
            self._log.info("common map", map_id=name.map_id, map_version=name.map_version)
        self._status.put(status_message(time.time_ns(), _status(fleet, f"{name.map_id}" if name else "")))

    def _fleet(self) -> Fleet:
        """What the common map is made of; nothing where the file is damaged, which the next merging writes anew."""
        try:
            return read_fleet(self._directory / MAP)
        except FleetFileError as error:
            self._log.warning("fleet", text=str(error))
            return Fleet()

    def _tell(self, who: str, text: str) -> None:
        """Log what became of a robot's map, where that has changed."""
        if self._told.get(who) != text:
            (self._log.info if text == "joined" else self._log.warning)("robot", map=who, text=text)
        self._told[who] = text

    def _end_merging(self) -> None:
        if self._merging is not None:
            self._merging.kill()
            self._merging.wait()

    def _key(self, name: str) -> str:
        return key_of(self._config.zenoh, name)


def _status(fleet: Fleet, map_id: str) -> Status:
    joined = [member for member in fleet.members if member.T_common_map]
    values = {"map": map_id, "maps": str(len(fleet.members)), "joined": str(len(joined))}
    values |= {f"member.{m.robot or '(no prefix)'}/{m.run}": _text(m) for m in _unsettled(fleet)}
    level = OK if len(joined) == len(fleet.members) else WARN
    return Status(level, f"{len(joined)} of {len(fleet.members)} maps are joined", values)


def _unsettled(fleet: Fleet) -> list[Member]:
    """The members that may change; the others become more from day to day."""
    return [member for member in fleet.members if not member.settled_in]


def _text(member: Member) -> str:
    if member.T_common_map is None:
        return f"version {member.map_version}, not joined: {member.why}"
    x, y, theta = member.T_common_map
    return f"version {member.map_version}, at {x:.2f} m, {y:.2f} m, {theta:.3f} rad"
