"""The daemon: Zenoh in, the live pose out at once, the estimation in a process of its own."""

import time
from contextlib import ExitStack

import zenoh

from wayfi.frontends.calibration import Calibration
from wayfi.service.blackbox.run_folder import RunFolder
from wayfi.service.config import Config
from wayfi.service.daemon.daemon_state import DaemonState
from wayfi.service.daemon.estimator_messages import Finish
from wayfi.service.daemon.main_loop import DaemonError, MainLoop
from wayfi.service.drive.known_map import MapReference
from wayfi.service.fleet.common_place import CommonPlace
from wayfi.service.fleet.keys import keyframes_key
from wayfi.service.fleet.map_server import MapServer
from wayfi.service.process.log_lines import LogLines
from wayfi.service.process.service_manager import ServiceManager
from wayfi.service.process.stop_signal import StopSignal
from wayfi.service.transport.commands import Commands
from wayfi.service.transport.publishers import Publishers
from wayfi.service.transport.subscribers import Subscribers

DRAIN_S = 3.0  # of the ten seconds between the signal and the last file
FINISH_S = 60.0  # the results of a long drive on a busy machine; a service manager that waits less kills the run


class Daemon:
    """One run, in a folder of its own, from its start to its results."""

    def __init__(
        self,
        config: Config,
        calibration: Calibration | None,
        folder: RunFolder,
        session: zenoh.Session,
        log: LogLines,
        stop: StopSignal,
        known: MapReference | None = None,
    ) -> None:
        self._config = config
        self._calibration = calibration
        self._folder = folder
        self._session = session
        self._log = log
        self._stop = stop
        self._known = known
        self._manager = ServiceManager()

    def run(self) -> None:
        """Serve until a stop or a reset is requested, then feed what still waits and write the results.

        Returns without results where the estimation ends each time on this drive: another run can be begun. Raises
        DaemonError where the results cannot be written, ZenohError where a key cannot be declared.
        """
        with ExitStack() as opened:
            self._publishers = opened.enter_context(Publishers(self._session, self._config.zenoh, self._config.frames))
            loop = MainLoop(self._config, self._calibration, self._folder, self._publishers, self._log, self._known)
            self._loop = opened.enter_context(loop)
            key = keyframes_key(self._config.zenoh)
            opened.enter_context(MapServer(self._session, key, self._folder.maps_served, self._log))
            known_id = self._known.map_id if self._known else ""
            opened.enter_context(
                CommonPlace(self._session, self._config, self._folder.path, self._publishers, self._log, known_id)
            )
            with ExitStack() as subscribed:
                self._serve(subscribed)
            if self._stop.requested:
                self._manager.stopping()
            if loop.machine.state is not DaemonState.ABANDONED:
                self._log.info("stopping", signal=self._stop.name or "reset", waiting=len(loop.inbox))
                self._drain()
                self._finish()
            self._folder.mark_stopped()

    def _serve(self, subscribed: ExitStack) -> None:
        """Handle messages and commands until the end is requested. A new run receives nothing before it is ready."""
        machine = self._loop.machine
        if self._folder.resumes:
            subscribed.enter_context(self._subscribers())
        while machine.state in (DaemonState.STARTING, DaemonState.RECOVERING):
            self._step()
        if machine.state is not DaemonState.RUNNING:
            return
        if not self._folder.resumes:
            subscribed.enter_context(self._subscribers())
        commands = subscribed.enter_context(Commands(self._session, self._config.zenoh, self._loop.inbox.wake))
        subscribed.enter_context(self._publishers.announce())
        self._log.info("ready", listen=",".join(self._config.zenoh.listen), folder=self._folder.path)
        self._manager.ready(f"run in {self._folder.path}")
        while machine.state.serving:
            self._step()
            self._execute(commands)

    def _subscribers(self) -> Subscribers:
        return Subscribers(self._session, self._config.zenoh, self._config.recording.every_topic, self._loop.inbox)

    def _step(self) -> None:
        self._manager.alive()
        self._loop.step()
        if self._stop.requested:
            self._loop.machine.request_end()

    def _execute(self, commands: Commands) -> None:
        while self._loop.machine.state.serving and (command := commands.pop()):
            self._loop.handler.execute(command)

    def _drain(self) -> None:
        """Feed what waits, with its poses published if the run is DRAINING, for at most `DRAIN_S`; drop the rest."""
        loop, deadline_s = self._loop, time.monotonic() + DRAIN_S
        while self._can_feed() and time.monotonic() < deadline_s:
            self._step()
        loop.inbox.drop_messages()
        loop.backlog.drop_messages()
        if loop.machine.state is DaemonState.DRAINING:
            loop.machine.change(DaemonState.FINISHING)

    def _can_feed(self) -> bool:
        """Whether something waits that can be fed: the backlog, and the inbox of a run that is DRAINING."""
        loop = self._loop
        return bool(loop.backlog) or (loop.machine.state is DaemonState.DRAINING and bool(loop.inbox))

    def _finish(self) -> None:
        """Have the results written. Raises DaemonError where they are not."""
        loop, deadline_s = self._loop, time.monotonic() + FINISH_S
        latencies = loop.diagnostics.latencies
        loop.backlog.put(Finish(loop.diagnostics.queue_drops(), {"latency": latencies.summary()}))
        while loop.written is None and not loop.estimation.ended and time.monotonic() < deadline_s:
            self._step()
        self._step()  # what was reported before the end
        loop.report_status()
        if loop.written is None:
            raise DaemonError("the estimation did not come to its end")
        if loop.written.error:
            raise DaemonError(loop.written.error)
        loop.machine.change(DaemonState.STOPPED)
        self._log.info("stopped", poses=loop.written.poses, folder=self._folder.path, **latencies.summary())
