"""A daemon that is killed resumes its run."""

import os
import random
import signal
from pathlib import Path

import pytest
from drives import RESULT_FILES, Simulated, circling, run, write
from live.daemons import ESTIMATOR, Robot, asked_for, routing, running
from live.kills import kill_after
from live.loopback import eventually, free_port
from live.runs import error_m, recorded, replays_alike

from wayfi.recordings.files.tum import read_tum
from wayfi.recordings.mcap.recording import open_recording
from wayfi.service.blackbox.checkpoint import CHECKPOINT
from wayfi.service.daemon.estimator_process import CHECKPOINT_EVERY
from wayfi.service.transport.subscribers import SYNC

KILLED_S = 1.0
HOLES_M = 0.05  # what rough wheels alone may drift by, over three holes of 3 to 4 s at twice real time


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
        daemon.settle()
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
        eventually(lambda: recorded(daemon) == half)
        daemon.kill()
        assert not (daemon.folder / CHECKPOINT).exists()
        daemon.start_again()
        daemon.publish(second, None)
        eventually((daemon.folder / CHECKPOINT).exists)
        assert daemon.stop() == 0, daemon.stderr
    assert replays_alike(daemon.folder, tmp_path / "replayed")


def test_a_run_that_is_stopped_while_it_recovers_has_its_results(tmp_path: Path) -> None:
    recording = write(tmp_path / "recording.mcap", circling(200))
    with running(tmp_path / "runs") as daemon:
        daemon.publish(recording, None)
        eventually(lambda: recorded(daemon) == 200)
        daemon.kill()
        daemon.launch_again()
        eventually(lambda: daemon.processes(ESTIMATOR))
        (estimator,) = daemon.processes(ESTIMATOR)
        os.kill(estimator, signal.SIGSTOP)
        eventually(lambda: asked_for(daemon.session, daemon.key(SYNC)))  # it receives what the drive goes on with
        daemon.process.send_signal(signal.SIGTERM)
        eventually(lambda: not asked_for(daemon.session, daemon.key(SYNC)))  # nor does it any more
        os.kill(estimator, signal.SIGCONT)
        assert daemon.stop() == 0, daemon.stderr
    assert not daemon.lines('"ready"')
    assert len(read_tum(daemon.folder / "trajectory.tum").stamps_ns) == 200
    assert not (daemon.folder / "running").exists()
    assert replays_alike(daemon.folder, tmp_path / "replayed")


def test_a_fresh_start_other_settings_or_a_lock_begin_a_run_of_their_own(tmp_path: Path) -> None:
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
