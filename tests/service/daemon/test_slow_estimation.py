"""An estimation that is too slow: no long piece of scans is missing, and at a stop it is not waited for what waits."""

import os
import signal
import threading
import time
from itertools import pairwise
from pathlib import Path

from drives import Simulated, write
from live.daemons import ESTIMATOR, running
from live.runs import assert_nothing_vanished, drops, replays_alike

from wayfi.frontends.measurements import SECOND_NS, LaserScan, Sensor
from wayfi.recordings.mcap.recording import open_recording
from wayfi.recordings.ros.codec import decode
from wayfi.recordings.ros.messages import DEFAULT_TOPICS
from wayfi.recordings.ros.topics import Encoding
from wayfi.service.daemon.daemon import DRAIN_S
from wayfi.service.transport.message_queue import QueueDrop

FED_AFTER_A_STOP_BYTES = 1 << 17  # a second or two of a planar laser
LONGEST_GAP_NS = SECOND_NS  # over which a laser that leads expects the robot to go on as it did


def scan_of(data: bytes) -> LaserScan:
    scan = decode(data, Sensor.SCAN, Encoding.CDR)
    assert isinstance(scan, LaserScan)
    return scan


def test_of_what_waits_at_a_stop_hardly_anything_is_still_processed(minute: Simulated, tmp_path: Path) -> None:
    recording, topics = write(tmp_path / "recording.mcap", minute.arrivals), set(DEFAULT_TOPICS.values())
    with running(tmp_path / "runs") as daemon:
        daemon.collect("wayfi/status")
        (estimator,) = daemon.processes(ESTIMATOR)
        os.kill(estimator, signal.SIGSTOP)
        daemon.publish(recording, None)
        daemon.process.send_signal(signal.SIGTERM)
        time.sleep(DRAIN_S + 1.0)
        os.kill(estimator, signal.SIGCONT)
        assert daemon.stop() == 0, daemon.stderr
    assert sum(len(r.data) for r in open_recording(daemon.folder) if r.topic in topics) < FED_AFTER_A_STOP_BYTES
    assert drops(daemon, "/scan")[QueueDrop.STOPPED] > 0
    assert_nothing_vanished(daemon, recording)
    assert replays_alike(daemon.folder, tmp_path / "replayed")


def test_an_estimation_that_stalls_misses_no_long_piece_of_scans(minute: Simulated, tmp_path: Path) -> None:
    """Half a minute of scans came meanwhile, where the queue holds ten seconds."""
    recording = write(tmp_path / "recording.mcap", minute.arrivals)
    with running(tmp_path / "runs") as daemon:
        daemon.collect("wayfi/status")
        (estimator,) = daemon.processes(ESTIMATOR)
        os.kill(estimator, signal.SIGSTOP)
        threading.Timer(3.0, os.kill, (estimator, signal.SIGCONT)).start()
        daemon.publish(recording, 10.0)
        assert daemon.stop() == 0, daemon.stderr
    stamps_ns = [scan_of(r.data).stamp_ns for r in open_recording(daemon.folder) if r.topic == "/scan"]
    assert drops(daemon, "/scan")[QueueDrop.QUEUE_FULL] > 0
    assert max(b - a for a, b in pairwise(stamps_ns)) <= LONGEST_GAP_NS
    assert replays_alike(daemon.folder, tmp_path / "replayed")
