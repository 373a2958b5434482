"""`wayfi run`: opens a session on Zenoh and makes one run after another on it, or merges the maps of a fleet."""

import zenoh

from wayfi.frontends.calibration import Calibration
from wayfi.service.blackbox.run_folder import open_run_folder
from wayfi.service.config import Config
from wayfi.service.daemon.daemon import Daemon
from wayfi.service.drive.known_map import MapReference
from wayfi.service.fleet.merging_daemon import MergingDaemon
from wayfi.service.process.log_lines import LogLines
from wayfi.service.process.stop_signal import StopSignal
from wayfi.service.transport.connection_watch import ConnectionWatch
from wayfi.service.transport.zenoh_session import UnreachableError, open_session, open_with_retries


def run_daemon(
    config: Config,
    calibration: Calibration | None,
    fresh: bool = False,
    quiet: bool = False,
    known: MapReference | None = None,
) -> int:
    """Run until SIGINT or SIGTERM, then write the results; returns the exit code. `quiet` logs warnings only.

    Localises in the map `known` if that is given. Resumes the newest run if that was not stopped cleanly, unless
    `fresh`; a reset begins a new run. Raises ZenohError where the endpoints cannot be used, RunFolderError where the
    folder cannot, DaemonError where a run cannot go on or its results cannot be written.
    """
    log = LogLines(quiet)
    with StopSignal() as stop:
        session = _open_patiently(config, stop, log)
        if session is not None:
            with session, ConnectionWatch(session, config.zenoh, log):
                while not stop.requested:
                    folder = open_run_folder(config, calibration, fresh, known)
                    Daemon(config, calibration, folder, session, log, stop, known).run()
                    fresh = True
    return 0


def run_merging_daemon(config: Config, quiet: bool = False) -> int:
    """Merge the maps of a fleet until SIGINT or SIGTERM; returns the exit code. `quiet` logs warnings only.

    Raises ZenohError where the endpoints cannot be used, MergingError where `recording.directory` cannot.
    """
    log = LogLines(quiet)
    with StopSignal() as stop:
        session = _open_patiently(config, stop, log)
        if session is not None:
            with session, ConnectionWatch(session, config.zenoh, log):
                MergingDaemon(config, session, log, stop).run()
    return 0


def _open_patiently(config: Config, stop: StopSignal, log: LogLines) -> zenoh.Session | None:
    """The session. A client waits until there is a router; None where a stop is requested meanwhile."""
    logged: set[str] = set()

    def keep_trying(error: UnreachableError) -> bool:
        if str(error) not in logged:
            log.warning("waiting", text=error)
        logged.add(str(error))
        return not stop.requested

    try:
        return open_with_retries(lambda: open_session(config.zenoh), keep_trying)
    except UnreachableError:
        return None
