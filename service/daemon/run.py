"""`wayfi run`: a session on Zenoh, and one run after another on it."""

import zenoh

from wayfi.frontends.calibration import Calibration
from wayfi.service.blackbox.run_folder import open_run_folder
from wayfi.service.config import Config
from wayfi.service.daemon.daemon import Daemon
from wayfi.service.process.log_lines import LogLines
from wayfi.service.process.stop_signal import StopSignal
from wayfi.service.transport.connection_watch import ConnectionWatch
from wayfi.service.transport.zenoh_session import UnreachableError, open_session, patiently


def run_daemon(config: Config, calibration: Calibration | None, fresh: bool = False, quiet: bool = False) -> int:
    """Run until SIGINT or SIGTERM, then write the results; returns the exit code. `quiet` logs only what warns.

    Goes on with the newest run if that was not stopped, unless `fresh`; a reset begins a new one. Raises ZenohError
    where its endpoints cannot be had, RunFolderError where its folder cannot, DaemonError where it cannot end well.
    """
    log = LogLines(quiet)
    with StopSignal() as stop:
        session = _meet(config, stop, log)
        if session is not None:
            with session, ConnectionWatch(session, config.zenoh, log):
                while not stop.requested:
                    Daemon(config, calibration, open_run_folder(config, calibration, fresh), session, log).run(stop)
                    fresh = True
    return 0


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
