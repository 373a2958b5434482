"""A Rerun recording on the timelines `stamp` and `keyframe`, in a file, live, or both at once."""

import socket
import threading
from pathlib import Path
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from wayfi.backend.errors import WayfiError
from wayfi.backend.pose2 import Floats, Pose2
from wayfi.recordings.rerun import arrows
from wayfi.recordings.rerun.config import RerunConfig

APPLICATION = "wayfi"
MIRRORED = [[1, 0, 0], [0, -1, 0], [0, 0, 1]]


class LogError(WayfiError):
    """The Rerun log cannot be written or served."""


class Stream:
    """Logs at `stamp_ns` and `keyframe`, which whoever owns the stream sets; safe to close from another thread."""

    def __init__(self, recording_id: str) -> None:
        self.stamp_ns = 0
        self.keyframe = 0
        self._set: tuple[int, int, int] | None = None
        self._recording = rr.RecordingStream(APPLICATION, recording_id=recording_id, send_properties=False)
        self._recording.set_log_time_enabled(False)

    def open(self, config: RerunConfig, path: Path | None, serve: bool, blueprint: rrb.Blueprint) -> None:
        """Write to `path` and serve on 127.0.0.1, as asked. Raises LogError where one of them is impossible."""
        sinks: list[Any] = [] if path is None else [rr.FileSink(path)]
        try:
            if serve:
                _require_free(config.port)
                limit = config.server_memory_limit
                sinks.append(rr.GrpcServerSink(bind_ip="127.0.0.1", port=config.port, server_memory_limit=limit))
            self._recording.set_sinks(*sinks, default_blueprint=blueprint)
        except (OSError, RuntimeError, ValueError) as error:
            served = f", or serve it on 127.0.0.1:{config.port}" if serve else ""
            raise LogError(f"cannot write the log {path}{served}: {error}: change --out or rerun.port") from error

    def log(self, path: str, *parts: rr.AsComponents) -> None:
        """What is so from now on at `path`."""
        self._set_time()
        self._recording.log(path, *parts)

    def style(self, path: str, *parts: rr.AsComponents) -> None:
        """What is so at `path` at all times: colours, widths, names."""
        self._recording.log(path, *parts, static=True)

    def name(self, text: str) -> None:
        """The recording's name in the viewer."""
        self._recording.send_recording_name(text)

    def close(self) -> None:
        """Everything logged is in the file afterwards."""
        self._recording.flush()
        self._recording.disconnect()

    def _set_time(self) -> None:
        now = (self.stamp_ns, self.keyframe, threading.get_ident())
        if now != self._set:
            self._recording.set_time("stamp", timestamp=np.datetime64(self.stamp_ns, "ns"))
            self._recording.set_time("keyframe", sequence=self.keyframe)
            self._set = now


def _require_free(port: int) -> None:
    """Raises OSError where somebody listens on `port`: Rerun itself would only print it."""
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        probe.bind(("127.0.0.1", port))


class Limiter:
    """Lets something pass at most `hz` times a second of the recording's time."""

    def __init__(self, hz: float) -> None:
        self._interval_ns = round(1e9 / hz)
        self._next_ns: int | None = None

    def passes(self, stamp_ns: int) -> bool:
        """Whether it is time again at `stamp_ns`; if so, the next time is one interval later."""
        if self._next_ns is not None and self._next_ns - self._interval_ns <= stamp_ns < self._next_ns:
            return False
        self._next_ns = stamp_ns + self._interval_ns
        return True


def frame(T: Pose2) -> rr.Transform3D:
    """The pose of a child entity in its parent's."""
    return rr.Transform3D.from_fields(translation=arrows.translation(T.x, T.y), quaternion=arrows.heading(T.theta))


def mirror() -> rr.Transform3D:
    """y up, as in ROS maps: Rerun's 2D views draw y down."""
    return rr.Transform3D(mat3x3=MIRRORED)


def thinned(points: NDArray[Any], most: int) -> NDArray[np.float32]:
    """At most `most` of (n, 2) points, evenly along the sweep, as float32."""
    return np.asarray(points[:: max(1, -(-len(points) // most))], np.float32)


def segments(a: Floats, b: Floats) -> NDArray[np.float32]:
    """(n, 2, 2) lines from (n, 2) points to (n, 2) points."""
    return np.stack([a, b], axis=1).astype(np.float32)
