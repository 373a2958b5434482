"""The daemon: Zenoh in, the live pose out at once, the estimation beside it in a process of its own."""

import time
from contextlib import ExitStack

import zenoh

from wayfi.backend.errors import WayfiError
from wayfi.frontends.calibration import Calibration
from wayfi.frontends.events import Event, PosePublished, StateChanged, Warned
from wayfi.frontends.measurements import Sensor
from wayfi.frontends.odometry.live_pose import LivePose
from wayfi.service.blackbox.blackbox import BlackBox
from wayfi.service.blackbox.recorder import Recorder
from wayfi.service.blackbox.run_folder import RunFolder
from wayfi.service.config import Config
from wayfi.service.daemon.command_handler import CommandHandler
from wayfi.service.daemon.diagnostics import Diagnostics
from wayfi.service.daemon.estimation import Estimation
from wayfi.service.daemon.estimator_messages import Backlog, Finish, News, Ready, Report, Saved, Start, Written
from wayfi.service.daemon.live_publisher import LivePublisher
from wayfi.service.drive.control_records import ControlKind, ControlRecord
from wayfi.service.drive.counters import Drops, merged
from wayfi.service.process.log_lines import LogLines
from wayfi.service.process.service_manager import ServiceManager
from wayfi.service.process.stop_signal import StopSignal
from wayfi.service.transport.commands import Commands
from wayfi.service.transport.message_queue import MessageQueue, QueueDrop, Received, limits_of
from wayfi.service.transport.publishers import Publishers
from wayfi.service.transport.subscribers import Subscribers

IDLE_S = 0.1
DRAIN_S = 3.0  # of the ten seconds between the signal and the last file
FINISH_S = 60.0
MOST_DEATHS = 2  # of the estimation, before one start of it comes through


class DaemonError(WayfiError):
    """A daemon that cannot go on."""


class Daemon:
    """One run, in a folder of its own: until it is told to stop, or to begin anew in another."""

    def __init__(
        self, config: Config, calibration: Calibration | None, folder: RunFolder, session: zenoh.Session, log: LogLines
    ) -> None:
        self._config = config
        self._calibration = calibration
        self._log = log
        self._manager = ServiceManager()
        self._session = session
        self._folder = folder
        self._topics = config.recording.topics
        limits = limits_of(config.zenoh)
        self._inbox = MessageQueue[Received](limits)
        self._backlog = Backlog(limits)
        self._diagnostics = Diagnostics(self._topics, self._inbox, self._backlog)
        self._dropped: Drops = {}
        self._dropped_said: set[tuple[str, str]] = set()
        self._ready = False
        self._written: Written | None = None
        self._finishing = False
        self._deaths = 0
        self._is_lost = False
        self._handler = CommandHandler(folder, self._backlog, log)
        self._recorder = Recorder(self._open_blackbox, folder.path, config.recording, self._complain)
        self._away_s = folder.away_s
        self._estimation = self._begin(folder.resumes)

    def run(self, stop: StopSignal) -> None:
        """Publish and estimate what comes until `stop` or a reset, then what still waits, and write every file."""
        with ExitStack() as opened:
            opened.callback(self._close_estimation)
            opened.callback(self._recorder.close)
            self._publishers = opened.enter_context(Publishers(self._session, self._config.zenoh))
            self._live = LivePublisher(self._live_pose(), self._publishers, self._diagnostics)
            with ExitStack() as subscribed:
                self._serve(subscribed, stop)
            if stop.requested:
                self._manager.stopping()
            if self._is_lost:
                self._folder.stopped()
                return
            self._log.info("stopping", signal=stop.name or "reset", waiting=len(self._inbox))
            self._finish()

    def _serve(self, subscribed: ExitStack, stop: StopSignal) -> None:
        """Until it is over. What comes while a drive is brought back waits; a new one hears nothing before."""
        if self._folder.resumes:
            subscribed.enter_context(self._subscribers())
        while not self._is_over(stop) and not self._ready:
            self._step()
        if self._is_over(stop):
            return
        if not self._folder.resumes:
            subscribed.enter_context(self._subscribers())
        commands = subscribed.enter_context(Commands(self._session, self._config.zenoh, self._inbox.wake))
        subscribed.enter_context(self._publishers.announce())
        self._log.info("ready", listen=",".join(self._config.zenoh.listen), folder=self._folder.path)
        self._manager.ready(f"run in {self._folder.path}")
        while not self._is_over(stop):
            self._step()
            for command in commands.take():
                self._handler.obey(command)

    def _is_over(self, stop: StopSignal) -> bool:
        return stop.requested or self._handler.reset or self._is_lost

    def _begin(self, resumes: bool) -> Estimation:
        """Start the estimation, on the drive that is in the folder or on a new one."""
        start = Start(self._config, self._calibration, self._folder.path, resumes)
        return Estimation(start, self._backlog, self._recorder, self._inbox.wake)

    def _subscribers(self) -> Subscribers:
        return Subscribers(self._session, self._config.zenoh, self._topics, self._inbox)

    def _live_pose(self) -> LivePose:
        return LivePose(self._config.odometry, self._calibration.wheels if self._calibration else None)

    def _close_estimation(self) -> None:
        self._estimation.close()

    def _open_blackbox(self) -> BlackBox:
        return BlackBox(self._folder.path, self._config, self._topics, self._calibration)

    def _step(self) -> None:
        """Take the next message, or what the estimation says, or wait for either."""
        self._manager.alive()
        ended = self._estimation.ended
        for report in self._estimation.reports():
            self._take_report(report)
        self._adopt()
        if ended and not self._finishing:
            self._begin_again()
        if self._ready and (received := self._inbox.pop(IDLE_S)):
            self._take(received)
        elif not self._ready:
            self._inbox.wait(IDLE_S)
        if self._diagnostics.due():
            self._tell_status()

    def _take(self, received: Received) -> None:
        """Publish the pose of an odometry message, and let the estimation have every message."""
        if self._handler.paused:
            self._backlog.refuse(received.sensor, QueueDrop.PAUSED)
            return
        if received.sensor is Sensor.ODOM:
            if not self._backlog.has_room(Sensor.ODOM):
                self._backlog.refuse(Sensor.ODOM, QueueDrop.QUEUE_FULL)
                return
            self._live.take(received)
        self._backlog.put(received)

    def _take_report(self, report: Report) -> None:
        match report:
            case Ready():
                self._be_ready(report)
            case News():
                self._take_news(report)
            case Saved():
                self._handler.take_saved(report)
            case Written():
                self._written = report

    def _be_ready(self, ready: Ready) -> None:
        """A drive that goes on after something of it was missed is ready when its estimate has come."""
        self._deaths = 0
        self._estimation.begin(ready)
        if self._away_s is None and ready.whole:
            self._ready = True
        else:
            self._go_on(self._away_s or 0.0)
        self._away_s = None

    def _go_on(self, away_s: float) -> None:
        self._ready = False
        self._live.begin(self._live_pose())
        self._backlog.put(ControlRecord(ControlKind.AWAY, round(away_s * 1e3)))
        self._log.warning("resumed", folder=self._folder.path, away_s=f"{away_s:.1f}")

    def _take_news(self, news: News) -> None:
        if news.estimate is not None:
            self._live.know(news.estimate)
        if news.dropped is not None:
            self._dropped = news.dropped
        for event in news.events:
            self._take_event(event)
        for text in news.complaints:
            self._complain(text)
        if news.map_cdr is not None:
            self._publishers.publish_map(news.map_cdr)

    def _adopt(self) -> None:
        """Use the newest estimate; what is fed from here on stands on it."""
        serial = None if self._finishing else self._live.adopt()
        if serial is not None:
            self._backlog.put(ControlRecord(ControlKind.ADOPT, serial))
            self._ready = True

    def _take_event(self, event: Event) -> None:
        match event:
            case PosePublished():
                self._live.publish(event, time.monotonic())
                return
            case StateChanged():
                self._log.info("state", state=event.state.value, reason=event.reason)
            case Warned():
                self._log.warning("warned", text=event.text)
        self._diagnostics.take(event, time.monotonic())

    def _begin_again(self) -> None:
        """The estimation has ended by itself: another goes on from the last checkpoint and the black box since.

        Poses go on meanwhile, on the estimate that there is, unless the black box misses something.
        """
        self._estimation.close()
        self._handler.give_up_saving("the estimation ended unexpectedly")
        self._deaths += 1
        if self._deaths > MOST_DEATHS:
            self._give_up()
            return
        self._complain("the estimation ended unexpectedly and is started again from its last checkpoint")
        self._recorder.flush()
        if self._away_s is None and not self._recorder.whole:
            self._away_s, self._ready = 0.0, False
        self._estimation = self._begin(resumes=True)

    def _give_up(self) -> None:
        """A drive whose own messages end the estimation each time is left; one that never began is no drive."""
        if not self._folder.resumes and not self._live.has_published:
            raise DaemonError("the estimation ends as soon as it is started")
        self._is_lost = True
        self._complain(f"{self._folder.path}: the estimation does not come through this drive; a new run begins")

    def _complain(self, text: str) -> None:
        self._log.warning("warned", text=text)

    def _tell_status(self) -> None:
        dropped = merged(self._dropped, self._diagnostics.queue_drops())
        extra = {
            "run": self._folder.path,
            "paused": str(self._handler.paused).lower(),
            "unpublished": self._publishers.unpublished,
            "unrecorded": self._recorder.unrecorded,
        }
        self._publishers.publish_status(time.time_ns(), self._diagnostics.status(dropped, extra))
        for topic, reason in {(topic, reason) for topic, reasons in dropped.items() for reason in reasons}:
            if (topic, reason) not in self._dropped_said:
                self._dropped_said.add((topic, reason))
                self._log.warning("dropped", topic=topic, reason=reason, note="said once; counted in wayfi/status")

    def _drain(self) -> None:
        """Let the estimation have what waits, but not for ever."""
        while self._ready and (received := self._inbox.pop(0.0)):
            self._take(received)
        deadline_s = time.monotonic() + DRAIN_S
        while len(self._backlog) and time.monotonic() < deadline_s:
            self._step()
        self._inbox.drop_messages()
        self._backlog.drop_messages()

    def _finish(self) -> None:
        """Feed what still waits, have the results written, and say so."""
        self._drain()
        self._finishing = True
        self._backlog.put(Finish(self._diagnostics.queue_drops(), {"latency": self._diagnostics.latencies.summary()}))
        deadline_s = time.monotonic() + FINISH_S
        while self._written is None and not self._estimation.ended and time.monotonic() < deadline_s:
            self._step()
        self._step()
        self._tell_status()
        if self._written is None or self._written.error:
            raise DaemonError(self._written.error if self._written else "the estimation did not come to its end")
        self._folder.stopped()
        latency = self._diagnostics.latencies.summary()
        self._log.info("stopped", poses=self._written.poses, folder=self._folder.path, **latency)
