"""A Rerun recording on the timelines `stamp` and `keyframe`, in a file, live, or both."""

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
FLIP_Y = [[1, 0, 0], [0, -1, 0], [0, 0, 1]]


class LogError(WayfiError):
    """The Rerun log cannot be written or served."""


class RerunStream:
    """Logs at the time `stamp_ns` and `keyframe`, which its owner sets. It may be closed from another thread."""

    def __init__(self, recording_id: str) -> None:
        self.stamp_ns = 0
        self.keyframe = 0
        self._time_set: tuple[int, int, int] | None = None
        self._path: Path | None = None
        self._recording = rr.RecordingStream(APPLICATION, recording_id=recording_id, send_properties=False)
        self._recording.set_log_time_enabled(False)

    def open(self, config: RerunConfig, path: Path | None, serve: bool, blueprint: rrb.Blueprint) -> None:
        """Open the file `path` if given, and with `serve` a server on 127.0.0.1. Raises LogError if one fails."""
        self._path = path
        sinks: list[Any] = [] if path is None else [rr.FileSink(path)]
        try:
            if serve:
                _require_free(config.port)
                limit = config.server_memory_limit
                sinks.append(rr.GrpcServerSink(bind_ip="127.0.0.1", port=config.port, server_memory_limit=limit))
            self._recording.set_sinks(*sinks, default_blueprint=blueprint)
        except (OSError, RuntimeError, ValueError) as error:
            served = f", or serve it on 127.0.0.1:{config.port} (see rerun.port)" if serve else ""
            raise LogError(f"cannot write the log {path}{served}: {error}") from error

    def log(self, path: str, *parts: rr.AsComponents) -> None:
        """Log `parts` at the entity `path` and the current time."""
        self._set_time()
        self._recording.log(path, *parts)

    def log_static(self, path: str, *parts: rr.AsComponents) -> None:
        """Log `parts` that are the same at all times, such as colours, widths and names."""
        self._recording.log(path, *parts, static=True)

    def close(self) -> None:
        """Finish the file and the server. Raises LogError where the file cannot be written to its end.

        The Rerun stream then never ends by itself, not even with the interpreter.
        """
        try:
            self._recording.flush()
        except RuntimeError as error:
            raise LogError(f"{self._path}: cannot be written to its end: is the disk full?") from error
        self._recording.disconnect()

    def _set_time(self) -> None:
        now = (self.stamp_ns, self.keyframe, threading.get_ident())
        if now != self._time_set:
            self._recording.set_time("stamp", timestamp=np.datetime64(self.stamp_ns, "ns"))
            self._recording.set_time("keyframe", sequence=self.keyframe)
            self._time_set = now


def _require_free(port: int) -> None:
    """Raise OSError if `port` is in use; Rerun itself would only print it."""
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        probe.bind(("127.0.0.1", port))


def transform(T: Pose2) -> rr.Transform3D:
    """The pose `T` of an entity in its parent."""
    return rr.Transform3D.from_fields(translation=arrows.translation(T.x, T.y), quaternion=arrows.heading(T.theta))


def flip_y() -> rr.Transform3D:
    """A transform that flips y: Rerun's 2D views draw y downwards."""
    return rr.Transform3D(mat3x3=FLIP_Y)


def downsampled(points: NDArray[Any], count: int) -> NDArray[np.float32]:
    """At most `count` of (n, 2) points, evenly spaced by index, as float32."""
    return np.asarray(points[:: max(1, -(-len(points) // count))], np.float32)


def segments(a: Floats, b: Floats) -> NDArray[np.float32]:
    """(n, 2, 2) lines from the points `a` (n, 2) to the points `b` (n, 2)."""
    return np.stack([a, b], axis=1).astype(np.float32)
