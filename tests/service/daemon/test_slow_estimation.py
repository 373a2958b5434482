"""An estimation that is too slow for what comes in: no long piece of scans is missing."""

import os
import signal
from itertools import pairwise
from pathlib import Path

from drives import Simulated, write
from live.daemons import ESTIMATOR, running
from live.loopback import eventually
from live.runs import assert_nothing_vanished, drops, poses_of, replays_alike

from wayfi.frontends.measurements import SECOND_NS, LaserScan, Odometry, Sensor
from wayfi.recordings.mcap.recording import open_recording
from wayfi.recordings.ros.codec import decode
from wayfi.recordings.ros.topics import Encoding
from wayfi.service.transport.message_queue import QueueDrop

RATE = 10.0  # times real time
LONGEST_GAP_NS = SECOND_NS  # over which a laser that leads expects the robot to go on as it did


def scan_of(data: bytes) -> LaserScan:
    scan = decode(data, Sensor.SCAN, Encoding.CDR)
    assert isinstance(scan, LaserScan)
    return scan


def test_an_estimation_that_stalls_misses_no_long_piece_of_scans(minute: Simulated, tmp_path: Path) -> None:
    """A minute of scans came meanwhile, of which its pipe holds twenty seconds, and the queue as many as of ten."""
    recording = write(tmp_path / "recording.mcap", minute.arrivals)
    with running(tmp_path / "runs") as daemon:
        daemon.collect("wayfi/pose")
        (estimator,) = daemon.processes(ESTIMATOR)
        os.kill(estimator, signal.SIGSTOP)
        daemon.publish(recording, RATE)
        eventually(lambda: len(poses_of(daemon)) == minute.count(Odometry))
        os.kill(estimator, signal.SIGCONT)
        daemon.settle()
        assert daemon.stop() == 0, daemon.stderr
    stamps_ns = [scan_of(r.data).stamp_ns for r in open_recording(daemon.folder) if r.topic == "/scan"]
    assert drops(daemon, "/scan")[QueueDrop.QUEUE_FULL] > 0
    assert max(b - a for a, b in pairwise(stamps_ns)) <= LONGEST_GAP_NS
    assert_nothing_vanished(daemon, recording)
    assert replays_alike(daemon.folder, tmp_path / "replayed")
