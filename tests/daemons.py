"""`wayfi run` as a process on loopback, a session of ours beside it, and what it says and leaves."""

import json
import math
import resource
import signal
import socket
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import zenoh
from loopback import CLI, eventually, free_port
from PIL import Image

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.measurements import Odometry, Sensor
from wayfi.recordings.files.map_files import UNKNOWN
from wayfi.recordings.files.tum import read_tum
from wayfi.recordings.mcap.parts import BLACKBOX, parts_of
from wayfi.recordings.mcap.recording import open_recording
from wayfi.recordings.ros.codec import decode, encode
from wayfi.recordings.ros.messages import DIAGNOSTIC_ARRAY, NS_PER_S, POSE_WITH_COVARIANCE, TYPESTORE
from wayfi.recordings.ros.ros_messages import Message
from wayfi.recordings.ros.topics import Encoding
from wayfi.recordings.trajectory import Trajectory
from wayfi.service.config import Config, ZenohConfig
from wayfi.service.evaluation.trajectory_scores import absolute_error
from wayfi.service.replay.playback_rate import PlaybackRate
from wayfi.service.replay.publish import publish_recording
from wayfi.service.replay.replay import ReplayOptions, replay, settings_for
from wayfi.service.transport.subscribers import SYNC
from wayfi.service.transport.zenoh_session import key_of, open_guest_session, open_session

PREFIX = "robot7"
MS_NS = 1_000_000


def accepts(endpoint: str) -> bool:
    host, port = endpoint.removeprefix("tcp/").split(":")
    with socket.socket() as probe:
        return probe.connect_ex((host, int(port))) == 0


def message_of(data: bytes, type_name: str) -> Message:
    return TYPESTORE.deserialize_cdr(data, type_name)


def odometry(number: int, encoding: Encoding = Encoding.CDR) -> bytes:
    return encode(Odometry((number + 1) * 100_000_000, Pose2(0.1 * number, 0.0, 0.0)), encoding)


def into(keep: Callable[[bytes], None]) -> Callable[[zenoh.Sample], None]:
    return lambda sample: keep(sample.payload.to_bytes())


def asked_for(session: zenoh.Session, key: str) -> list[bytes]:
    return [reply.ok.payload.to_bytes() for reply in session.get(key, timeout=5.0) if reply.ok]


@dataclass
class Running:
    """A daemon process, and a session of ours beside it."""

    process: "subprocess.Popen[str]"
    settings: list[str]
    directory: Path
    config: ZenohConfig
    session: zenoh.Session
    samples: dict[str, list[bytes]] = field(default_factory=dict)
    subscribers: list[Any] = field(default_factory=list)
    stderr: str = ""

    @property
    def rerun_port(self) -> int:
        return int(next(word for word in self.settings if word.startswith("rerun.port=")).split("=")[1])

    @property
    def folder(self) -> Path:
        """The newest run's."""
        return max(self.directory.iterdir())

    def key(self, name: str) -> str:
        return key_of(self.config, name)

    def collect(self, *names: str) -> None:
        for name in names:
            keep = self.samples.setdefault(name, []).append
            self.subscribers.append(self.session.declare_subscriber(self.key(name), into(keep)))

    def status(self) -> dict[str, str]:
        """The values of the newest status; none before the first."""
        if not self.samples["wayfi/status"]:
            return {}
        message = message_of(self.samples["wayfi/status"][-1], DIAGNOSTIC_ARRAY)
        (status,) = message.status
        assert status.name == "wayfi"
        return {pair.key: pair.value for pair in status.values}

    def publish(self, recording: Path, rate: float | None) -> None:
        """Publish a recording; returns when it has been received."""
        publish_recording(recording, Config(zenoh=self.config), rate)

    def stop(self, number: signal.Signals = signal.SIGTERM) -> int:
        self.process.send_signal(number)
        _, self.stderr = self.process.communicate(timeout=30)
        return self.process.returncode

    def kill(self) -> float:
        """Kill it at once; returns the moment on the monotonic clock."""
        self.process.kill()
        self.process.wait()
        return time.monotonic()

    def start_again(self, *flags: str) -> None:
        """Another process with the same settings; returns when it is ready."""
        self.process.communicate()
        self.process = _launch([*self.settings, *flags])
        self.wait_until_alive()

    def wait_until_alive(self) -> None:
        eventually(lambda: alive(self) or self.process.poll() is not None)

    def lines(self, text: str) -> list[str]:
        """The lines that it logged with `text` in them; to be asked after it has ended."""
        return [line for line in self.stderr.splitlines() if text in line]

    def processes(self, module: str = "") -> list[int]:
        """The numbers of its child processes, and theirs, that run `module`."""
        found, waiting = [], [self.process.pid]
        while waiting:
            children = Path(f"/proc/{waiting.pop()}/task").glob("*/children")
            numbers = [int(word) for path in children for word in path.read_text().split()]
            found += numbers
            waiting += numbers
        return [pid for pid in found if module in Path(f"/proc/{pid}/cmdline").read_text()]

    def fill_disk(self) -> None:
        """From now on no file that it writes can grow."""
        for pid in (self.process.pid, *self.processes()):
            resource.prlimit(pid, resource.RLIMIT_FSIZE, (0, resource.RLIM_INFINITY))


@contextmanager
def running(directory: Path, *extra: str, router: str = "") -> Iterator[Running]:
    """A daemon that is ready; `router` is the endpoint of one that it is to be a client of."""
    if router:
        config = ZenohConfig(mode="client", connect=[router], prefix=PREFIX)
    else:
        config = ZenohConfig(listen=[f"tcp/127.0.0.1:{free_port()}"], prefix=PREFIX)
    zenoh_values = (f"zenoh.{name}={getattr(config, name)}" for name in ("mode", "listen", "connect", "prefix"))
    values = (*zenoh_values, f"recording.directory={directory}", f"rerun.port={free_port()}", *extra)
    settings = [word for value in values for word in ("--set", value)]
    process = _launch(settings)
    daemon: Running | None = None
    try:
        endpoint = (config.connect or config.listen)[0]
        eventually(lambda: accepts(endpoint) or process.poll() is not None)
        with open_guest_session(config) as session:
            daemon = Running(process, settings, directory, config, session)
            daemon.wait_until_alive()
            yield daemon
    finally:
        last = daemon.process if daemon else process
        last.kill()
        last.communicate()


@contextmanager
def routing(endpoint: str) -> Iterator[zenoh.Session]:
    """A router in this process."""
    with open_session(ZenohConfig(mode="router", listen=[endpoint])) as session:
        yield session


def alive(daemon: Running) -> bool:
    return any(reply.ok for reply in daemon.session.liveliness().get(daemon.key("wayfi/alive"), timeout=1.0))


def _launch(arguments: list[str]) -> "subprocess.Popen[str]":
    return subprocess.Popen([*CLI, "run", *arguments], stderr=subprocess.PIPE, text=True)


class Robot(threading.Thread):
    """Publishes a recording at `rate` times real time, whatever becomes of the daemon; `put` is when and what."""

    def __init__(self, daemon: Running, recording: Path, rate: float) -> None:
        super().__init__()
        self._daemon = daemon
        self._recording = recording
        self._rate = rate
        self.put: list[tuple[float, bytes]] = []

    def run(self) -> None:
        playback = PlaybackRate(self._rate)
        for record in open_recording(self._recording):
            playback.wait_for(record.log_time_ns)
            self._daemon.session.put(
                self._daemon.key(record.topic),
                record.data,
                encoding=zenoh.Encoding.APPLICATION_CDR,
                congestion_control=zenoh.CongestionControl.BLOCK,
            )
            self.put.append((time.monotonic(), record.data))

    def finish(self) -> None:
        """Wait until all was put and received."""
        self.join()
        assert asked_for(self._daemon.session, self._daemon.key(SYNC))


# What it was told, said and left


def odometry_of(recording: Path) -> list[Odometry]:
    messages = [decode(r.data, Sensor.ODOM, Encoding.CDR) for r in open_recording(recording) if r.topic == "/odom"]
    return [m for m in messages if isinstance(m, Odometry)]


def poses_of(daemon: Running) -> list[Message]:
    return [message_of(data, POSE_WITH_COVARIANCE) for data in daemon.samples["wayfi/pose"]]


def stamp_ns(header: Message) -> int:
    return int(header.stamp.sec) * NS_PER_S + int(header.stamp.nanosec)


def pose_of(message: Message) -> Pose2:
    p, q = message.pose.pose.position, message.pose.pose.orientation
    return Pose2(p.x, p.y, 2 * math.atan2(q.z, q.w))


def report_of(folder: Path) -> dict[str, Any]:
    report: dict[str, Any] = json.loads((folder / "report.json").read_text())
    return report


def replays_alike(folder: Path, out: Path) -> bool:
    """Whether the black box gives the trajectories that the daemon left, to the byte."""
    config, calibration = settings_for(folder, (), (), None)
    replay(folder, config, calibration, ReplayOptions(out, rrd=False))
    return all((out / n).read_bytes() == (folder / n).read_bytes() for n in ("trajectory.tum", "online.tum"))


def error_m(folder: Path, truth: Trajectory) -> float:
    """ATE RMSE, m, at the stamps of the trajectory."""
    estimate = read_tum(folder / "trajectory.tum")
    at = np.isin(truth.stamps_ns // MS_NS, estimate.stamps_ns // MS_NS)
    assert at.any()
    return absolute_error(estimate, Trajectory(truth.stamps_ns[at], truth.poses[at])).error.ate_rmse_m


# Kills


@dataclass(frozen=True, slots=True)
class Kill:
    """The moments from which a daemon heard, and when it was killed, on the monotonic clock; and what it left.

    `messages` are those of the newest part of its black box; `map_cells` is 0 where there was no map yet.
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
