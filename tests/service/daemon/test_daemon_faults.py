"""What goes wrong around a daemon: a router that is gone, a viewer that hangs, an estimation that ends."""

import os
import pickle
import signal
import subprocess
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import rerun_cli
from drives import Simulated, circling, write
from live.daemons import ESTIMATOR, Robot, Running, accepts, routing, running
from live.loopback import eventually, free_port
from live.runs import assert_every_pose, assert_nothing_vanished, odometry_of, poses_of, replays_alike, stamp_ns

from wayfi.frontends.measurements import Odometry
from wayfi.recordings.mcap.parts import BLACKBOX, next_part
from wayfi.recordings.mcap.writer import McapWriter
from wayfi.recordings.ros.topics import CONTROL_TOPIC, CONTROL_TYPE
from wayfi.service.blackbox.checkpoint import write_checkpoint
from wayfi.service.drive.control_records import ControlKind, ControlRecord

RATE = 30.0  # times real time
RERUN = Path(rerun_cli.__file__).with_name("rerun")  # not the script that starts it, which alone would stop
GROWTH_MB = 100  # of which 16 MiB are kept for viewers that come late


def test_a_router_that_is_gone_for_a_while(minute: Simulated, tmp_path: Path) -> None:
    cut = 2 * len(minute.arrivals) // 3
    recording, rest = (
        write(tmp_path / f"{n}.mcap", part) for n, part in enumerate((minute.arrivals[:cut], minute.arrivals[cut:]))
    )
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    with ExitStack() as stack:
        first = stack.enter_context(ExitStack())
        first.enter_context(routing(endpoint))
        daemon = stack.enter_context(running(tmp_path / "runs", router=endpoint))
        daemon.collect("wayfi/pose")
        robot = Robot(daemon, recording, 8.0)
        robot.start()
        eventually(lambda: len(poses_of(daemon)) > 50)
        first.close()
        time.sleep(1.0)
        before = len(poses_of(daemon))
        stack.enter_context(routing(endpoint))
        daemon.wait_until_alive()
        robot.finish()
        daemon.publish(rest, 8.0)
        daemon.settle()
        assert len(poses_of(daemon)) > before + 50
        assert daemon.stop() == 0, daemon.stderr
    assert_every_pose(daemon, overtaken=minute.count(Odometry) // 2)
    assert replays_alike(daemon.folder, tmp_path / "replayed")


def test_a_viewer_that_stops_reading(minute: Simulated, tmp_path: Path) -> None:
    recording = write(tmp_path / "recording.mcap", minute.arrivals)
    much = ("rerun.server_memory_limit='16MiB'", "rerun.scan_hz=100.0", "rerun.pose_hz=100.0", "rerun.scan_points=2000")
    with running(tmp_path / "runs", *much) as daemon, viewing(daemon, tmp_path / "seen.rrd") as viewer:
        daemon.collect("wayfi/pose")
        viewer.send_signal(signal.SIGSTOP)
        (log,) = daemon.processes("wayfi.recordings.rerun.log_server")
        before_mb = memory_mb(log)
        daemon.publish(recording, RATE)
        assert memory_mb(log) - before_mb < GROWTH_MB
        daemon.settle()
        assert daemon.stop() == 0, daemon.stderr
    assert_every_pose(daemon)
    assert_nothing_vanished(daemon, recording)


@contextmanager
def viewing(daemon: Running, seen: Path) -> Iterator["subprocess.Popen[bytes]"]:
    """A program that receives what a viewer does."""
    eventually(lambda: accepts(f"tcp/127.0.0.1:{daemon.rerun_port}"))
    url = f"rerun+http://127.0.0.1:{daemon.rerun_port}/proxy"
    with subprocess.Popen(
        [RERUN, "--bind", "127.0.0.1", "--port", str(free_port()), url, "--save", str(seen)], stderr=subprocess.DEVNULL
    ) as viewer:
        try:
            eventually(seen.exists)
            yield viewer
        finally:
            viewer.kill()


def memory_mb(pid: int) -> float:
    (line,) = [line for line in Path(f"/proc/{pid}/status").read_text().splitlines() if line.startswith("VmRSS")]
    return int(line.split()[1]) / 1024


def test_an_estimation_that_is_killed_delays_no_pose(minute: Simulated, tmp_path: Path) -> None:
    recording = write(tmp_path / "recording.mcap", minute.arrivals)
    last_ns = odometry_of(recording)[-1].stamp_ns
    with running(tmp_path / "runs") as daemon:
        daemon.collect("wayfi/pose")
        robot = Robot(daemon, recording, 8.0)
        robot.start()
        eventually(lambda: len(poses_of(daemon)) > 100)
        (first,) = daemon.processes(ESTIMATOR)
        os.kill(first, signal.SIGKILL)
        eventually(lambda: set(daemon.processes(ESTIMATOR)) - {first})
        (second,) = set(daemon.processes(ESTIMATOR)) - {first}
        os.kill(second, signal.SIGSTOP)
        robot.finish()
        eventually(lambda: stamp_ns(poses_of(daemon)[-1].header) == last_ns)
        os.kill(second, signal.SIGCONT)
        daemon.settle()
        assert daemon.stop() == 0, daemon.stderr
    assert len(daemon.lines("the estimation ended unexpectedly")) == 1
    assert not daemon.lines("resumed")
    assert_nothing_vanished(daemon, recording)
    assert_every_pose(daemon)
    assert replays_alike(daemon.folder, tmp_path / "replayed")


class Deadly:
    """Unpickling it ends the process."""

    def __reduce__(self) -> tuple[Any, ...]:
        return os._exit, (1,)


def test_a_drive_that_ends_the_estimation_each_time_is_left_for_a_new_run(tmp_path: Path) -> None:
    recording = write(tmp_path / "recording.mcap", circling(200))
    deadly = pickle.dumps(Deadly())
    with running(tmp_path / "runs") as daemon:
        daemon.publish(recording, None)
        lost = daemon.folder
        daemon.kill()
        with McapWriter(next_part(lost, BLACKBOX)) as writer:
            writer.write(CONTROL_TOPIC, CONTROL_TYPE, "json", 0, ControlRecord(ControlKind.CHECKPOINT, 1).to_json())
        write_checkpoint(lost, 1, deadly)
        daemon.start_again()
        daemon.collect("wayfi/pose")
        daemon.publish(recording, None)
        eventually(lambda: len(poses_of(daemon)) == 200)
        daemon.settle()
        assert daemon.stop() == 0, daemon.stderr
    assert daemon.folder != lost
    assert not (lost / "running").exists()
    assert len(daemon.lines("does not come through this drive; a new run begins")) == 1
    assert replays_alike(daemon.folder, tmp_path / "replayed")
