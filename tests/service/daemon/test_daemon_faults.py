"""What goes wrong around a daemon: it stays up, publishes a pose for every odometry message, and replays alike."""

import math
import os
import pickle
import random
import signal
import subprocess
import time
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import pytest
import rerun_cli
from daemons import (
    Robot,
    Running,
    accepts,
    asked_for,
    error_m,
    eventually,
    free_port,
    kill_after,
    odometry_of,
    poses_of,
    replays_alike,
    report_of,
    routing,
    running,
    stamp_ns,
)
from drives import RESULT_FILES, Arrival, Simulated, run, simulated, write
from rerun.chunk import RrdReader

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.events import DropReason
from wayfi.frontends.measurements import LaserScan, Measurement, Odometry, WifiScan
from wayfi.frontends.odometry.timebase import CONFIRMING_MESSAGES
from wayfi.recordings.files.tum import read_tum
from wayfi.recordings.mcap.parts import BLACKBOX, next_part, parts_of
from wayfi.recordings.mcap.recording import McapWriter, open_recording
from wayfi.recordings.ros.topics import CONTROL_TOPIC
from wayfi.recordings.simulation.run import EPOCH_NS
from wayfi.recordings.simulation.worlds import World
from wayfi.service.blackbox.checkpoint import CHECKPOINT, write_checkpoint
from wayfi.service.blackbox.disk import KINDS, MIB, keep_budget
from wayfi.service.daemon.estimation import CHECKPOINT_EVERY
from wayfi.service.drive.control_records import ControlKind, ControlRecord
from wayfi.service.drive.counters import merged
from wayfi.service.transport.queues import QueueDrop

RATE = 30.0  # times real time
SHARE = 0.05
LATE_S = 0.5
CLOSE_M = 0.2
RERUN = Path(rerun_cli.__file__).with_name("rerun")  # not the script that starts it, which alone would stop
GROWTH_MB = 100  # of which 16 MiB are kept for viewers that come late
BUDGET_MB = 20
KILLED_S = 1.0
HOLES_M = 0.05  # what rough wheels alone may drift by, over three holes of 3 to 4 s at twice real time
JUMP_S = 10.0
ESTIMATOR = "wayfi.service.daemon.estimator"


@pytest.fixture(scope="module")
def longer() -> Simulated:
    """A minute and a half in the car park."""
    return simulated(World.CARPARK, 1.5, seed=4)


# On the way


def mangled(arrivals: Iterable[Arrival], seed: int) -> list[Arrival]:
    """Of all messages one share lost, one sent twice, and one late."""
    chance = random.Random(seed)
    out = []
    for arrival in arrivals:
        if chance.random() >= SHARE:
            late = arrival.delayed(chance.uniform(0, LATE_S) if chance.random() < SHARE else 0.0)
            out += [late] * (2 if chance.random() < SHARE else 1)
    return out


def silent(arrivals: Iterable[Arrival], kind: type[Measurement]) -> list[Arrival]:
    """Nothing of a sensor for a minute."""
    return [a for a in arrivals if not (15 <= a.second < 75 and isinstance(a.measurement, kind))]


def jumping(arrivals: Iterable[Arrival]) -> list[Arrival]:
    """All clocks are set forward after 20 s, and back after 40 s."""
    return [a.stamped(JUMP_S) if 20 <= a.second < 40 else a for a in arrivals]


def driven(tmp_path: Path, arrivals: list[Arrival], *settings: str) -> Running:
    """A daemon that was given `arrivals` and stopped, with what holds for every drive asserted."""
    recording = write(tmp_path / "recording.mcap", arrivals)
    with running(tmp_path / "runs", *settings) as daemon:
        daemon.collect("wayfi/pose", "wayfi/status")
        daemon.publish(recording, RATE)
        assert daemon.stop() == 0, daemon.stderr
    assert_nothing_vanished(daemon, recording)
    assert replays_alike(daemon.folder, tmp_path / "replayed")
    return daemon


def assert_nothing_vanished(daemon: Running, recording: Path) -> None:
    """Every message was fed, or is counted as one that the queues dropped."""
    report = report_of(daemon.folder)
    unfed = {t: sum(n for why, n in whys.items() if why in set(QueueDrop)) for t, whys in report["dropped"].items()}
    assert merged({"": report["messages"]}, {"": unfed})[""] == open_recording(recording).message_counts


def assert_every_pose(daemon: Running, overtaken: int = 0, restamped: int = 0) -> None:
    """Every odometry message that was not dropped for a reason gave a pose, but for so many that came too late.

    `restamped` may have been published under another stamp, before the estimation told of a jump of the clock.
    """
    used = report_of(daemon.folder)["messages"]["/odom"] - sum(drops(daemon, "/odom").values())
    kept = len(read_tum(daemon.folder / "online.tum").poses)
    assert used <= kept
    assert kept - overtaken <= len(poses_of(daemon)) <= kept + restamped


def drops(daemon: Running, topic: str) -> dict[str, int]:
    """How many messages were dropped, by reason."""
    reasons: dict[str, int] = report_of(daemon.folder)["dropped"].get(topic, {})
    return reasons


def test_messages_lost_sent_twice_and_late(minute: Simulated, tmp_path: Path) -> None:
    daemon = driven(tmp_path, mangled(minute.arrivals, seed=1))
    assert_every_pose(daemon)
    assert {DropReason.DUPLICATE, DropReason.STAMP_BACK} <= set(drops(daemon, "/odom"))
    assert error_m(daemon.folder, minute.truth) < CLOSE_M


@pytest.mark.parametrize("kind", [Odometry, LaserScan, WifiScan])
def test_a_sensor_silent_for_a_minute(longer: Simulated, tmp_path: Path, kind: type[Measurement]) -> None:
    daemon = driven(tmp_path, silent(longer.arrivals, kind))
    assert_every_pose(daemon)
    assert error_m(daemon.folder, longer.truth) < CLOSE_M


def test_clocks_that_jump(minute: Simulated, tmp_path: Path) -> None:
    daemon = driven(tmp_path, jumping(minute.arrivals))
    assert_every_pose(daemon, overtaken=CONFIRMING_MESSAGES, restamped=CONFIRMING_MESSAGES)
    assert drops(daemon, "/odom") == {DropReason.STAMP_BACK: CONFIRMING_MESSAGES - 1}


def test_all_of_it_at_once(longer: Simulated, tmp_path: Path) -> None:
    daemon = driven(tmp_path, mangled(jumping(silent(longer.arrivals, WifiScan)), seed=2))
    assert_every_pose(daemon, overtaken=CONFIRMING_MESSAGES, restamped=CONFIRMING_MESSAGES)
    assert len(poses_of(daemon)) > 0.8 * longer.count(Odometry)


# Around the daemon


def test_a_router_that_is_gone_for_a_while(minute: Simulated, tmp_path: Path) -> None:
    recording = write(tmp_path / "recording.mcap", minute.arrivals)
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
        eventually(lambda: len(poses_of(daemon)) > before + 50)
        robot.finish()
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
        assert daemon.stop() == 0, daemon.stderr
    assert_every_pose(daemon)
    assert_nothing_vanished(daemon, recording)


@contextmanager
def viewing(daemon: Running, seen: Path) -> Iterator["subprocess.Popen[bytes]"]:
    """A program that is shown what a viewer is shown."""
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


def test_an_estimation_that_is_killed_holds_up_no_pose(minute: Simulated, tmp_path: Path) -> None:
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
        eventually(lambda: asked_for(daemon.session, daemon.key("wayfi/command/save")))  # all before it is estimated
        assert daemon.stop() == 0, daemon.stderr
    assert len(daemon.lines("the estimation ended unexpectedly")) == 1
    assert not daemon.lines("resumed")
    assert_nothing_vanished(daemon, recording)
    assert_every_pose(daemon)
    assert replays_alike(daemon.folder, tmp_path / "replayed")


class Deadly:
    """What unpickles it is dead."""

    def __reduce__(self) -> tuple[Any, ...]:
        return os._exit, (1,)


def test_a_drive_that_the_estimation_does_not_come_through_is_left_for_a_new_run(tmp_path: Path) -> None:
    recording = write(tmp_path / "recording.mcap", circling(200))
    deadly = pickle.dumps(Deadly())
    with running(tmp_path / "runs") as daemon:
        daemon.publish(recording, None)
        lost = daemon.folder
        daemon.kill()
        with McapWriter(next_part(lost, BLACKBOX)) as writer:
            writer.write(CONTROL_TOPIC, "wayfi/Mark", "json", 0, ControlRecord(ControlKind.CHECKPOINT, 1).to_json())
        write_checkpoint(lost, 1, deadly)
        daemon.start_again()
        daemon.collect("wayfi/pose")
        daemon.publish(recording, None)
        eventually(lambda: len(poses_of(daemon)) == 200)
        assert daemon.stop() == 0, daemon.stderr
    assert daemon.folder != lost
    assert not (lost / "running").exists()
    assert len(daemon.lines("does not come through this drive; a new run begins")) == 1
    assert replays_alike(daemon.folder, tmp_path / "replayed")


# The disk


def test_a_full_disk(minute: Simulated, tmp_path: Path) -> None:
    recording = write(tmp_path / "recording.mcap", minute.arrivals)
    with running(tmp_path / "runs") as daemon:
        daemon.collect("wayfi/pose", "wayfi/status")
        daemon.fill_disk()
        daemon.publish(recording, RATE)
        eventually(lambda: len(poses_of(daemon)) == minute.count(Odometry))
        eventually(lambda: int(daemon.status()["unrecorded"]) > 0)
        code = daemon.stop()
    assert code == 1
    assert len(daemon.lines("recording stopped")) == 1
    assert len(daemon.lines("the results cannot be written")) == 1
    assert "Traceback" not in daemon.stderr


def test_room_that_is_left_to_others(minute: Simulated, tmp_path: Path) -> None:
    recording = write(tmp_path / "recording.mcap", minute.arrivals)
    with running(tmp_path / "runs", "recording.keep_free_mb=1e12") as daemon:
        daemon.collect("wayfi/pose", "wayfi/status")
        daemon.publish(recording, 8.0)
        eventually(lambda: int(daemon.status()["unrecorded"]) > 0)
        assert daemon.stop() == 0, daemon.stderr
    assert_every_pose(daemon)
    (line,) = daemon.lines("recording stopped")
    assert "keep_free_mb" in line


@pytest.mark.slow
def test_many_parts_and_a_budget(tmp_path: Path) -> None:
    recording, older = tmp_path / "recording.mcap", tmp_path / "runs" / "20200101T000000Z"
    write(recording, circling(2 * CHECKPOINT_EVERY + 1))
    older.mkdir(parents=True)
    for name in ("blackbox_0001.mcap", "session_0001.rrd"):
        with (older / name).open("wb") as file:
            file.truncate(BUDGET_MB * MIB)
    small = ("recording.part_mb=0.01", "rerun.part_mb=0.1", f"recording.budget_mb={BUDGET_MB}")
    with running(tmp_path / "runs", *small) as daemon:
        daemon.publish(recording, RATE / 3)
        assert daemon.stop() == 0, daemon.stderr
    assert not list(older.iterdir())
    parts, sessions = (parts_of(daemon.folder, kind) for kind in KINDS)
    assert len(parts) > 2
    assert len(sessions) > 1
    for session in sessions:
        assert RrdReader(session).stream().filter(content="/map/**").to_chunks(), session
    assert_nothing_vanished(daemon, recording)
    assert replays_alike(daemon.folder, tmp_path / "replayed")


def circling(messages: int) -> Iterator[Arrival]:
    """Odometry alone, at 100 Hz on a circle."""
    for number in range(messages):
        at_ns, angle = EPOCH_NS + number * 10_000_000, number * 1e-3
        pose = Pose2(5 * math.sin(angle), 5 - 5 * math.cos(angle), angle)
        yield Arrival(at_ns, Odometry(at_ns, pose))


def test_the_newest_part_of_each_kind_stays(tmp_path: Path) -> None:
    names = [f"blackbox_{n:04d}.mcap" for n in (1, 2, 3)] + [f"session_{n:04d}.rrd" for n in (1, 2)]
    for name in names:
        (tmp_path / "now").mkdir(exist_ok=True)
        (tmp_path / "now" / name).write_bytes(bytes(MIB))
    keep_budget(tmp_path, tmp_path / "now", 4.0)
    assert sorted(path.name for path in (tmp_path / "now").iterdir()) == names[1:]
    keep_budget(tmp_path, tmp_path / "now", 0.1)
    assert sorted(path.name for path in (tmp_path / "now").iterdir()) == [names[2], names[4]]


# A kill


@pytest.mark.slow
def test_three_kills(longer: Simulated, tmp_path: Path) -> None:
    recording, chance = write(tmp_path / "recording.mcap", longer.arrivals), random.Random(7)
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    with routing(endpoint), running(tmp_path / "runs", router=endpoint) as daemon:
        daemon.collect("wayfi/pose")
        robot = Robot(daemon, recording, 2.0)
        robot.start()
        kills = [kill_after(daemon, chance.uniform(1.0, 3.0)) for _ in range(3)]
        robot.finish()
        assert daemon.stop() == 0, daemon.stderr
    folder = daemon.folder
    kept = {record.data for record in open_recording(folder)}
    assert max(kill.lost_s(robot, kept) for kill in kills) < KILLED_S
    assert min(kill.messages for kill in kills) > 0
    assert kills[-1].map_cells > 0
    assert len(daemon.lines("resumed")) == 1
    assert {path.name for path in folder.iterdir()} >= set(RESULT_FILES) - {"session.rrd"}
    assert replays_alike(folder, tmp_path / "replayed")
    run(recording, tmp_path / "undisturbed")
    undisturbed_m = error_m(tmp_path / "undisturbed", longer.truth)
    assert error_m(daemon.folder, longer.truth) < 1.2 * undisturbed_m + HOLES_M


def test_a_checkpoint_comes_however_often_it_is_killed(tmp_path: Path) -> None:
    arrivals, half = list(circling(5 * CHECKPOINT_EVERY // 4)), CHECKPOINT_EVERY // 2
    first, second = (write(tmp_path / f"{n}.mcap", part) for n, part in enumerate((arrivals[:half], arrivals[half:])))
    with running(tmp_path / "runs") as daemon:
        daemon.publish(first, None)
        time.sleep(KILLED_S)
        daemon.kill()
        assert not (daemon.folder / CHECKPOINT).exists()
        daemon.start_again()
        daemon.publish(second, None)
        eventually((daemon.folder / CHECKPOINT).exists)
        assert daemon.stop() == 0, daemon.stderr
    assert replays_alike(daemon.folder, tmp_path / "replayed")


def test_what_is_not_gone_on_with(tmp_path: Path) -> None:
    changed = "map.resolution_m=0.1"
    with running(tmp_path / "runs") as daemon:
        daemon.kill()
        daemon.start_again("--fresh")
        assert len(list(daemon.directory.iterdir())) == 2
        daemon.kill()
        daemon.start_again("--set", changed)
        assert len(list(daemon.directory.iterdir())) == 3
        with running(tmp_path / "runs", changed) as second:
            assert len(list(daemon.directory.iterdir())) == 4
            assert second.stop() == 0, second.stderr
        assert daemon.stop() == 0, daemon.stderr
