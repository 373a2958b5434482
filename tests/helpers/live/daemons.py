"""`wayfi run` as a process on loopback, a session of ours beside it, and a robot that publishes to it."""

import resource
import signal
import socket
import subprocess
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import zenoh
from live.loopback import CLI, LONG_S, eventually, free_port

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.measurements import SECOND_NS, Odometry
from wayfi.recordings.mcap.recording import open_recording
from wayfi.recordings.ros.codec import encode
from wayfi.recordings.ros.messages import DIAGNOSTIC_ARRAY, TYPESTORE
from wayfi.recordings.ros.ros_messages import Message
from wayfi.recordings.ros.topics import Encoding
from wayfi.service.config import Config, ZenohConfig
from wayfi.service.replay.playback_rate import PlaybackRate
from wayfi.service.replay.publish import publish_recording
from wayfi.service.transport.subscribers import SYNC
from wayfi.service.transport.zenoh_session import key_of, open_guest_session, open_session

PREFIX = "robot7"
ESTIMATOR = "wayfi.service.daemon.estimator"
LOSSLESS = "zenoh.scan_queue=100000"  # however slow the estimation, all scans come to it


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
    return [reply.ok.payload.to_bytes() for reply in session.get(key, timeout=LONG_S) if reply.ok]


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
        return self._status()[1]

    def _status(self) -> tuple[int, dict[str, str]]:
        """The stamp of the newest status, ns on the wall clock, and its values; 0 and none before the first."""
        if not self.samples["wayfi/status"]:
            return 0, {}
        message = message_of(self.samples["wayfi/status"][-1], DIAGNOSTIC_ARRAY)
        (status,) = message.status
        assert status.name == "wayfi"
        stamp = message.header.stamp
        return stamp.sec * SECOND_NS + stamp.nanosec, {pair.key: pair.value for pair in status.values}

    def publish(self, recording: Path, rate: float | None) -> None:
        """Publish a recording; returns when it has been received."""
        publish_recording(recording, Config(zenoh=self.config), rate)

    def settle(self, left: int = 0) -> None:
        """Wait until so few of the messages received wait for the estimation: a stop drops what waits for too long."""
        now_ns = time.time_ns()

        def settled() -> bool:
            stamp_ns, values = self._status()
            waiting = sum(int(value) for key, value in values.items() if key.startswith("queue."))
            return stamp_ns > now_ns and waiting <= left

        eventually(settled)

    def stop(self, number: signal.Signals = signal.SIGTERM) -> int:
        self.process.send_signal(number)
        _, self.stderr = self.process.communicate(timeout=LONG_S)
        return self.process.returncode

    def kill(self) -> float:
        """Kill it at once; returns the moment on the monotonic clock."""
        self.process.kill()
        self.process.wait()
        return time.monotonic()

    def launch_again(self, *flags: str) -> None:
        """Start another process with the same settings."""
        self.process.communicate()
        self.process = _launch([*self.settings, *flags])

    def start_again(self, *flags: str) -> None:
        """Another process with the same settings; returns when it is ready."""
        self.launch_again(*flags)
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
            numbers = _children(waiting.pop())
            found += numbers
            waiting += numbers
        return [pid for pid in found if module in _command(pid)]

    def fill_disk(self) -> None:
        """From now on no file that it writes can grow."""
        for pid in (self.process.pid, *self.processes()):
            resource.prlimit(pid, resource.RLIMIT_FSIZE, (0, resource.RLIM_INFINITY))


@contextmanager
def running(
    directory: Path, *extra: str, router: str = "", flags: Sequence[str] = (), prefix: str = PREFIX
) -> Iterator[Running]:
    """A daemon that is ready; `router` is the endpoint of one that it is to be a client of, `extra` are settings."""
    if router:
        config = ZenohConfig(mode="client", connect=[router], prefix=prefix)
    else:
        config = ZenohConfig(listen=[f"tcp/127.0.0.1:{free_port()}"], prefix=prefix)
    zenoh_values = (f"zenoh.{name}={getattr(config, name)}" for name in ("mode", "listen", "connect", "prefix"))
    values = (*zenoh_values, f"recording.directory={directory}", f"rerun.port={free_port()}", *extra)
    settings = [*(word for value in values for word in ("--set", value)), *flags]
    process = _launch(settings)
    daemon: Running | None = None
    try:
        endpoint = (config.connect or config.listen)[0]
        eventually(lambda: accepts(endpoint) or process.poll() is not None)
        with open_guest_session(config) as session:
            daemon = Running(process, settings, directory, config, session)
            daemon.collect("wayfi/status")
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


def _children(pid: int) -> list[int]:
    """The child processes of one; none where it has ended."""
    with suppress(OSError):
        paths = Path(f"/proc/{pid}/task").glob("*/children")
        return [int(word) for path in paths for word in path.read_text().split()]
    return []


def _command(pid: int) -> str:
    """What a process runs; empty where it has ended."""
    with suppress(OSError):
        return Path(f"/proc/{pid}/cmdline").read_text()
    return ""


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
