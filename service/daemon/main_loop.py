"""The daemon's main loop: publishes and feeds messages, and handles what the estimation reports."""

import time

from wayfi.backend.errors import WayfiError
from wayfi.backend.pose2 import Pose2
from wayfi.frontends.calibration import Calibration
from wayfi.frontends.events import Event, PosePublished, StateChanged, Warned
from wayfi.frontends.measurements import Sensor
from wayfi.recordings.closing import Closing
from wayfi.service.blackbox.blackbox import BlackBox
from wayfi.service.blackbox.recorder import Recorder
from wayfi.service.blackbox.run_folder import RunFolder
from wayfi.service.config import Config
from wayfi.service.daemon.command_handler import CommandHandler
from wayfi.service.daemon.daemon_state import DaemonState, StateMachine
from wayfi.service.daemon.diagnostics import Diagnostics
from wayfi.service.daemon.estimator_messages import (
    Backlog,
    Compiling,
    Edited,
    Ready,
    Refused,
    Report,
    Saved,
    Start,
    Update,
    Written,
)
from wayfi.service.daemon.live_publisher import LivePublisher
from wayfi.service.daemon.status_reporter import StatusReporter
from wayfi.service.daemon.supervisor import Supervisor
from wayfi.service.drive.control_records import ControlKind, ControlRecord
from wayfi.service.drive.known_map import MapReference
from wayfi.service.process.log_lines import LogLines
from wayfi.service.transport.message_queue import MessageQueue, QueueDrop, Received, limits_of
from wayfi.service.transport.publishers import Publishers

IDLE_S = 0.1


class DaemonError(WayfiError):
    """A run that cannot go on, or whose results cannot be written."""


class MainLoop(Closing):
    """Handles messages from `inbox` and feeds the estimation from `backlog`, one `step` at a time; a context manager.

    `machine` holds the run's state; `written` what the estimation reported of the results, None until then.
    """

    def __init__(
        self,
        config: Config,
        calibration: Calibration | None,
        folder: RunFolder,
        publishers: Publishers,
        log: LogLines,
        known: MapReference | None = None,
    ) -> None:
        limits = limits_of(config.zenoh, config.recording.every_topic)
        self._folder = folder
        self._known = known
        self._publishers = publishers
        self._log = log
        self._gap_s = folder.away_s or 0.0  # without messages, recorded when the estimation is ready
        self.written: Written | None = None
        self.machine = StateMachine(folder.resumes)
        self.inbox = MessageQueue[Received](limits)
        self.backlog = Backlog(limits)
        self.diagnostics = Diagnostics(self.inbox, self.backlog)
        self.handler = CommandHandler(
            folder, self.backlog, self.machine, log, lambda: known is not None or self._live.has_published
        )
        self._live = LivePublisher(config, calibration, publishers, self.diagnostics, begins_map=known is None)
        self._status = StatusReporter(publishers, self.diagnostics, log)
        self._recorder = Recorder(
            lambda: BlackBox(folder.path, config, calibration, known), folder.path, config.recording, self._warn
        )
        start = Start(config, calibration, folder.path, folder.resumes, known)
        self.estimation = Supervisor(start, self.backlog, self._recorder, self.inbox.wake)

    def close(self) -> None:
        """Close the black box and end the estimation."""
        self._recorder.close()
        self.estimation.close()

    def step(self) -> None:
        """Handle what the estimation reports, then the next message; waits for either for at most `IDLE_S`.

        Raises DaemonError where the estimation ends each time and a new run would not help.
        """
        ended = self.estimation.ended  # asked before the reports, so that none is left when it has
        for report in self.estimation.reports():
            self._handle_report(report)
        self._adopt()
        if ended and self.machine.state is not DaemonState.FINISHING:
            self._handle_death()
        self._handle_next_message()
        if self.diagnostics.due():
            self.report_status()

    def report_status(self) -> None:
        """Publish the status as of now."""
        self._status.report(
            {
                "run": self._folder.path,
                "mode": self.handler.mode,
                "map": self._known or "",
                "common_map": _text(self._publishers.T_common_map),
                "paused": str(self.handler.paused).lower(),
                "unpublished": self._publishers.unpublished,
                "unrecorded": self._recorder.unrecorded,
            }
        )

    def _handle_next_message(self) -> None:
        if self.machine.state not in (DaemonState.RUNNING, DaemonState.DRAINING):
            self.inbox.wait(IDLE_S)
        elif received := self.inbox.pop(IDLE_S):
            self._handle_message(received)

    def _handle_message(self, received: Received) -> None:
        """Publish the pose of an odometry message, and feed every message to the estimation.

        Odometry for which the backlog has no room is refused: a message whose pose is published must be fed.
        """
        if self.handler.paused:
            self.backlog.refuse(received.topic, QueueDrop.PAUSED)
            return
        if received.sensor is Sensor.ODOM:
            if not self.backlog.has_room(received.topic):
                self.backlog.refuse(received.topic, QueueDrop.QUEUE_FULL)
                return
            self._live.handle(received)
        self.backlog.put(received)

    def _handle_report(self, report: Report) -> None:
        match report:
            case Compiling():
                self._log.info("compiling", functions=report.functions, text="once; about half a minute")
            case Refused():
                raise DaemonError(report.why)
            case Ready():
                self._handle_ready(report)
            case Update():
                self._handle_update(report)
            case Saved():
                self.handler.handle_saved(report)
            case Edited():
                self.handler.handle_edited(report)
            case Written():
                self.written = report

    def _handle_ready(self, ready: Ready) -> None:
        """Feed the estimation. A drive from which messages are missing waits for its first estimate."""
        missing = not (ready.whole and self._recorder.whole)
        self.handler.mode = ready.mode
        self.estimation.feed(ready)
        match self.machine.state:
            case DaemonState.STARTING:
                self.machine.change(DaemonState.RUNNING)
            case DaemonState.RUNNING if missing:
                self._recover()
                self._record_gap()
            case DaemonState.RECOVERING:
                self._record_gap()

    def _recover(self) -> None:
        """Publish nothing until a new estimate is known: the present one counts messages that are missing."""
        self.machine.change(DaemonState.RECOVERING)
        self._live.reset()

    def _record_gap(self) -> None:
        self.backlog.put(ControlRecord(ControlKind.AWAY, round(self._gap_s * 1e3)))
        self._log.warning("resumed", folder=self._folder.path, away_s=f"{self._gap_s:.1f}")
        self._gap_s = 0.0

    def _handle_update(self, update: Update) -> None:
        if update.estimate is not None:
            self._live.set_estimate(update.estimate)
        if update.dropped is not None:
            self.diagnostics.estimation_drops = update.dropped
        for event in update.events:
            self._handle_event(event)
        for text in update.warnings:
            self._warn(text)
        if update.map_cdr is not None:
            self._publishers.publish_map(update.map_cdr)

    def _adopt(self) -> None:
        """Adopt the newest estimate, and record after which message. Nothing may follow the request to finish."""
        serial = None if self.machine.state is DaemonState.FINISHING else self._live.adopt()
        if serial is None:
            return
        self.backlog.put(ControlRecord(ControlKind.ADOPT, serial))
        if self.machine.state is DaemonState.RECOVERING:
            self.machine.change(DaemonState.RUNNING)

    def _handle_event(self, event: Event) -> None:
        match event:
            case PosePublished():
                self._live.publish(event, time.monotonic())
                return
            case StateChanged():
                self._log.info("state", state=event.state.value, reason=event.reason)
            case Warned():
                self._log.warning("warned", text=event.text)
        self.diagnostics.handle(event, time.monotonic())

    def _handle_death(self) -> None:
        """Start the estimation again. Poses go on meanwhile, unless the black box lacks messages."""
        self.handler.fail_waiting("the estimation ended unexpectedly")
        if not self.estimation.restart():
            self._give_up()
            return
        self._warn("the estimation ended unexpectedly and is started again from its last checkpoint")
        if self._recorder.whole:
            return
        if self.machine.state is DaemonState.RUNNING:
            self._recover()
        elif self.machine.state is DaemonState.DRAINING:
            self.machine.change(DaemonState.FINISHING)

    def _give_up(self) -> None:
        """Leave this drive to a new run. Raises DaemonError where that would not help, or the end was requested."""
        if not self._folder.resumes and not self._live.has_published:
            raise DaemonError("the estimation ends as soon as it is started")
        if self.machine.state is DaemonState.DRAINING:
            raise DaemonError("the estimation did not come to its end")
        self.machine.change(DaemonState.ABANDONED)
        self._warn(f"{self._folder.path}: the estimation does not come through this drive; a new run begins")

    def _warn(self, text: str) -> None:
        self._log.warning("warned", text=text)


def _text(T: Pose2 | None) -> str:
    return f"map lies at {T.x:.2f} m, {T.y:.2f} m, {T.theta:.3f} rad in it" if T else ""
