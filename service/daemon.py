"""`wayfi run`: Zenoh in, the pipeline, Zenoh out; a black box and a live log beside it."""

import hashlib
import json
import time
from contextlib import ExitStack
from datetime import UTC, datetime
from pathlib import Path

import zenoh

from wayfi.backend.errors import WayfiError
from wayfi.frontends.calibration import Calibration
from wayfi.frontends.events import Event, GridRedrawn, StateChanged, Warned
from wayfi.recordings.files import write_text
from wayfi.recordings.log import Log
from wayfi.recordings.rerun_log import open_log
from wayfi.recordings.rerun_stream import LogError
from wayfi.service.blackbox import BlackBox
from wayfi.service.config import Config
from wayfi.service.connection_watch import ConnectionWatch
from wayfi.service.drive import Drive, topics_of
from wayfi.service.log_lines import LogLines
from wayfi.service.publishers import Publishers
from wayfi.service.queues import Queues, Received, limits_of
from wayfi.service.results import Source, write_results
from wayfi.service.stop_signal import StopSignal
from wayfi.service.subscribers import Subscribers
from wayfi.service.vital_signs import VitalSigns
from wayfi.service.warm_up import warm_up
from wayfi.service.zenoh_session import UnreachableError, open_session, patiently

IDLE_S = 0.1
DRAIN_S = 4.0  # of the ten seconds between the signal and the last file


class DaemonError(WayfiError):
    """A daemon that cannot start."""


def run_daemon(config: Config, calibration: Calibration | None, quiet: bool = False) -> int:
    """Run until SIGINT or SIGTERM, then write the results; returns the exit code. `quiet` logs only what warns.

    Raises ZenohError where its endpoints cannot be had, DaemonError where its folder cannot.
    """
    log = LogLines(quiet)
    with StopSignal() as stop:
        session = _meet(config, stop, log)
        if session is not None:
            with session, ConnectionWatch(session, config.zenoh, log):
                warm_up(config)
                Daemon(config, calibration, session, log).run(stop)
    return 0


class Daemon:
    """One run, in a folder of its own."""

    def __init__(self, config: Config, calibration: Calibration | None, session: zenoh.Session, log: LogLines) -> None:
        self._config = config
        self._log = log
        self._session = session
        self._folder = _make_folder(Path(config.recording.directory))
        self._topics = topics_of(config.recording)
        self._queues = Queues(limits_of(config.zenoh))
        self._vitals = VitalSigns(self._topics, self._queues)
        self._drive = Drive(config, calibration, _open_live_log(config, self._folder, log))
        self._blackbox = BlackBox(self._folder, config, self._topics, calibration)
        self._started_s = time.monotonic()
        self._dropped_said: set[tuple[str, str]] = set()

    def run(self, stop: StopSignal) -> None:
        """Feed the pipeline what comes until `stop`, then what still waits, and write every file."""
        with ExitStack() as opened:
            opened.enter_context(self._blackbox)
            self._publishers = opened.enter_context(Publishers(self._session, self._config.zenoh, self._config.map))
            subscribers = Subscribers(self._session, self._config.zenoh, self._topics, self._queues)
            with subscribers, self._publishers.announce():
                self._log.info("ready", listen=",".join(self._config.zenoh.listen), folder=self._folder)
                while not stop.requested:
                    self._step(self._queues.take(IDLE_S))
            self._log.info("stopping", signal=stop.name, waiting=sum(self._queues.depths().values()))
            self._drain()
            self._finish()

    def _step(self, received: Received | None) -> None:
        if received is None:
            self._blackbox.flush_if_due()
        else:
            self._blackbox.write(received)
            events = self._drive.feed(received.sensor, received.encoding, received.data)
            for event in events:
                self._publish(event, received.received_s)
            self._drive.show(events)
        if self._vitals.due():
            self._tell_status()

    def _publish(self, event: Event, received_s: float) -> None:
        self._publishers.publish(event)
        self._vitals.take(event, received_s)
        match event:
            case StateChanged():
                self._log.info("state", state=event.state.value, reason=event.reason)
            case Warned():
                self._log.warning("warned", text=event.text)

    def _tell_status(self) -> None:
        dropped = self._dropped()
        extra = {"run": self._folder, "unpublished": self._publishers.unpublished}
        self._publishers.publish_status(time.time_ns(), self._vitals.status(dropped, extra))
        for topic, reason in {(topic, reason) for topic, reasons in dropped.items() for reason in reasons}:
            if (topic, reason) not in self._dropped_said:
                self._dropped_said.add((topic, reason))
                self._log.warning("dropped", topic=topic, reason=reason, note="said once; counted in wayfi/status")

    def _dropped(self) -> dict[str, dict[str, int]]:
        """What never came to the pipeline, and what it could not use."""
        dropped = {topic: dict(reasons) for topic, reasons in self._drive.tally.dropped.items()}
        for sensor, reasons in self._queues.dropped().items():
            of_topic = dropped.setdefault(self._topics[sensor], {})
            for reason, count in reasons.items():
                of_topic[reason] = of_topic.get(reason, 0) + count
        return dropped

    def _drain(self) -> None:
        deadline_s = time.monotonic() + DRAIN_S
        while time.monotonic() < deadline_s and (received := self._queues.take(0.0)):
            self._step(received)
        self._queues.clear()

    def _finish(self) -> None:
        """End the drive, publish its map, and write its files."""
        self._blackbox.close()
        result = self._drive.finish()
        grid, stamps_ns = result.grid, result.stamps_ns
        stamp_ns = int(stamps_ns[-1]) if len(stamps_ns) else 0
        self._publishers.publish(GridRedrawn(stamp_ns, grid.probability(), grid.resolution_m, grid.origin_xy_m))
        self._tell_status()
        self._add_queue_drops()
        run_s = time.monotonic() - self._started_s
        report = write_results(
            self._folder, self._drive, result, Source(run_s, run_s, _sha256(self._blackbox.path), [])
        )
        report["latency"] = self._vitals.latencies.summary()
        write_text(self._folder / "report.json", json.dumps(report, indent=1) + "\n")
        self._log.info("stopped", poses=len(result.stamps_ns), folder=self._folder, **report["latency"])

    def _add_queue_drops(self) -> None:
        for sensor, reasons in self._queues.dropped().items():
            for reason, count in reasons.items():
                for _ in range(count):
                    self._drive.tally.drop(self._topics[sensor], reason)


def _meet(config: Config, stop: StopSignal, log: LogLines) -> zenoh.Session | None:
    """The session. A client waits until there is a router, or until it is told to stop: None."""
    said: set[str] = set()

    def keep_trying(error: UnreachableError) -> bool:
        if str(error) not in said:
            log.warning("waiting", text=error)
        said.add(str(error))
        return not stop.requested

    try:
        return patiently(lambda: open_session(config.zenoh), keep_trying)
    except UnreachableError:
        return None


def _make_folder(directory: Path) -> Path:
    """A new folder in `directory`, named by this second in UTC; the next second where there is one already."""
    while True:
        folder = directory / datetime.now(UTC).strftime("%Y%m%dT%H%M%SZ")
        try:
            folder.mkdir(parents=True)
            return folder
        except FileExistsError as error:
            if not directory.is_dir():
                raise DaemonError(f"{directory}: is no folder; see recording.directory") from error
            time.sleep(IDLE_S)
        except OSError as error:
            raise DaemonError(f"{folder}: cannot be made: {error.strerror}; see recording.directory") from None


def _open_live_log(config: Config, folder: Path, log: LogLines) -> Log:
    """The log in its file and live; in its file alone where the port cannot be had."""
    path, recording_id = folder / "session_0001.rrd", f"wayfi-{folder.name}"
    try:
        return open_log(config.rerun, path, serve=True, recording_id=recording_id)
    except LogError as error:
        log.warning("not_live", text=error)
        return open_log(config.rerun, path, recording_id=recording_id)


def _sha256(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
