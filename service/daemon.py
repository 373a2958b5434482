"""The daemon: Zenoh in, the live pose out at once, the estimation beside it in a process of its own."""

import time
from contextlib import ExitStack

import zenoh

from wayfi.backend.errors import WayfiError
from wayfi.frontends.calibration import Calibration
from wayfi.frontends.events import Event, PosePublished, StateChanged, Warned
from wayfi.frontends.measurements import Odometry, Sensor
from wayfi.recordings.codec import decode
from wayfi.recordings.codec_error import CodecError
from wayfi.service.backlog import Backlog
from wayfi.service.blackbox import BlackBox
from wayfi.service.command_handler import CommandHandler
from wayfi.service.commands import Commands
from wayfi.service.config import Config
from wayfi.service.drive import topics_of
from wayfi.service.estimation import Estimation
from wayfi.service.estimator_messages import Finish, News, Ready, Start, Written
from wayfi.service.live_drive import live_pose
from wayfi.service.live_pose import Estimate
from wayfi.service.log_lines import LogLines
from wayfi.service.marks import Mark, MarkKind
from wayfi.service.publishers import Publishers
from wayfi.service.queues import QueueDrop, Queues, Received, limits_of
from wayfi.service.recorder import Recorder
from wayfi.service.run_folder import RunFolder
from wayfi.service.service_manager import ServiceManager
from wayfi.service.stop_signal import StopSignal
from wayfi.service.subscribers import Subscribers
from wayfi.service.tally import Drops, merged
from wayfi.service.vital_signs import VitalSigns

IDLE_S = 0.1
DRAIN_S = 3.0  # of the ten seconds between the signal and the last file
FINISH_S = 60.0


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
        self._topics = topics_of(config.recording)
        limits = limits_of(config.zenoh)
        self._inbox = Queues(limits)
        self._backlog = Backlog(limits)
        self._vitals = VitalSigns(self._topics, self._inbox, self._backlog)
        self._dropped: Drops = {}
        self._dropped_said: set[tuple[str, str]] = set()
        self._live = live_pose(config, calibration)
        self._ready = False
        self._estimate: Estimate | None = None
        self._adopt_from_s = 0.0
        self._published_ns = -1
        self._written: Written | None = None
        self._finishing = False
        self._handler = CommandHandler(folder, self._backlog, log)
        self._recorder = Recorder(self._open_blackbox, folder.path, config.recording, self._complain)
        self._estimation = self._begin(folder.away_s)

    def run(self, stop: StopSignal) -> None:
        """Publish and estimate what comes until `stop` or a reset, then what still waits, and write every file."""
        with ExitStack() as opened:
            opened.callback(self._close_estimation)
            opened.callback(self._recorder.close)
            self._publishers = opened.enter_context(Publishers(self._session, self._config.zenoh))
            subscribed = opened.enter_context(ExitStack())
            if self._folder.resumes:
                subscribed.enter_context(self._subscribers())
            while not stop.requested and not self._ready:
                self._step()
            if not self._folder.resumes:
                subscribed.enter_context(self._subscribers())
            commands = subscribed.enter_context(Commands(self._session, self._config.zenoh, self._inbox.wake))
            subscribed.enter_context(self._publishers.announce())
            self._log.info("ready", listen=",".join(self._config.zenoh.listen), folder=self._folder.path)
            self._manager.ready(f"run in {self._folder.path}")
            while not stop.requested and not self._handler.reset:
                self._step()
                for command in commands.take():
                    self._handler.obey(command)
            subscribed.close()
            if stop.requested:
                self._manager.stopping()
            self._log.info("stopping", signal=stop.name or "reset", waiting=sum(self._inbox.depths().values()))
            self._finish()

    def _begin(self, away_s: float | None) -> Estimation:
        """Start the estimation, on the drive that is in the folder where the daemon was away."""
        self._ready = False
        self._estimate = None
        self._away_s = away_s
        start = Start(self._config, self._calibration, self._folder.path, away_s is not None)
        return Estimation(start, self._backlog, self._recorder, self._inbox.wake)

    def _subscribers(self) -> Subscribers:
        return Subscribers(self._session, self._config.zenoh, self._topics, self._inbox)

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
        if self._ready and (received := self._inbox.take(IDLE_S)):
            self._take(received)
        elif not self._ready:
            self._inbox.wait(IDLE_S)
        if self._vitals.due():
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
            self._publish_live(received)
        self._backlog.put(received)

    def _publish_live(self, received: Received) -> None:
        try:
            odometry = decode(received.data, Sensor.ODOM, received.encoding)
        except CodecError:
            return
        assert isinstance(odometry, Odometry)
        pose = self._live.take(odometry)
        if pose is not None:
            self._publish(pose, received.received_s)

    def _publish(self, pose: PosePublished, received_s: float) -> None:
        if pose.stamp_ns > self._published_ns:
            self._published_ns = pose.stamp_ns
            self._publishers.publish_pose(pose)
            self._vitals.take(pose, received_s)

    def _take_report(self, report: Ready | News | Written) -> None:
        match report:
            case Ready():
                self._be_ready(report)
            case News():
                self._take_news(report)
            case Written():
                self._take_written(report)

    def _be_ready(self, ready: Ready) -> None:
        """A drive that goes on is ready when its estimate has come."""
        self._estimation.begin(ready.checkpoint)
        self._ready = self._away_s is None
        if self._away_s is not None:
            self._live = live_pose(self._config, self._calibration)
            self._backlog.put(Mark(MarkKind.AWAY, round(self._away_s * 1e3)))
            self._log.warning("resumed", folder=self._folder.path, away_s=f"{self._away_s:.1f}")

    def _take_news(self, news: News) -> None:
        self._estimate = news.estimate or self._estimate
        if news.dropped is not None:
            self._dropped = news.dropped
        for event in news.events:
            self._take_event(event)
        for text in news.complaints:
            self._complain(text)
        if news.map_cdr is not None:
            self._publishers.publish_map(news.map_cdr)

    def _adopt(self) -> None:
        """Use the newest estimate; where that takes long, messages come first four fifths of the time."""
        estimate, now_s = self._estimate, time.monotonic()
        if estimate is None or now_s < self._adopt_from_s or self._finishing:
            return
        self._estimate = None
        for pose in self._live.adopt(estimate):
            self._publish(pose, now_s)
        self._backlog.put(Mark(MarkKind.ADOPT, estimate.serial))
        self._ready = True
        end_s = time.monotonic()
        self._adopt_from_s = end_s + 4 * (end_s - now_s)

    def _take_event(self, event: Event) -> None:
        match event:
            case PosePublished():
                self._publish(event, time.monotonic())
                return
            case StateChanged():
                self._log.info("state", state=event.state.value, reason=event.reason)
            case Warned():
                self._log.warning("warned", text=event.text)
        self._vitals.take(event, time.monotonic())

    def _begin_again(self) -> None:
        """The estimation has ended by itself: another goes on from the last checkpoint."""
        self._complain("the estimation ended unexpectedly and is started again from its last checkpoint")
        self._estimation.close()
        self._handler.give_up_saving("the estimation ended unexpectedly")
        self._recorder.flush()
        self._estimation = self._begin(0.0)

    def _take_written(self, written: Written) -> None:
        if not self._handler.take_written(written):
            self._written = written

    def _complain(self, text: str) -> None:
        self._log.warning("warned", text=text)

    def _tell_status(self) -> None:
        dropped = merged(self._dropped, self._vitals.queue_drops())
        extra = {
            "run": self._folder.path,
            "paused": str(self._handler.paused).lower(),
            "unpublished": self._publishers.unpublished,
            "unrecorded": self._recorder.unrecorded,
        }
        self._publishers.publish_status(time.time_ns(), self._vitals.status(dropped, extra))
        for topic, reason in {(topic, reason) for topic, reasons in dropped.items() for reason in reasons}:
            if (topic, reason) not in self._dropped_said:
                self._dropped_said.add((topic, reason))
                self._log.warning("dropped", topic=topic, reason=reason, note="said once; counted in wayfi/status")

    def _drain(self) -> None:
        """Let the estimation have what waits, but not for ever."""
        while self._ready and (received := self._inbox.take(0.0)):
            self._take(received)
        deadline_s = time.monotonic() + DRAIN_S
        while self._backlog.waiting and time.monotonic() < deadline_s:
            self._step()
        self._inbox.clear()
        self._backlog.drop_messages()

    def _finish(self) -> None:
        """Feed what still waits, have the results written, and say so."""
        self._drain()
        self._finishing = True
        self._backlog.put(Finish(self._vitals.queue_drops(), {"latency": self._vitals.latencies.summary()}))
        deadline_s = time.monotonic() + FINISH_S
        while self._written is None and not self._estimation.ended and time.monotonic() < deadline_s:
            self._step()
        self._step()
        self._tell_status()
        if self._written is None or self._written.error:
            raise DaemonError(self._written.error if self._written else "the estimation did not come to its end")
        self._folder.stopped()
        latency = self._vitals.latencies.summary()
        self._log.info("stopped", poses=self._written.poses, folder=self._folder.path, **latency)
