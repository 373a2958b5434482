"""A daemon on a disk that is full or small."""

from pathlib import Path

import pytest
from drives import Simulated, circling, write
from live.daemons import running
from live.loopback import eventually
from live.runs import assert_every_pose, assert_nothing_vanished, poses_of, replays_alike
from rerun.chunk import RrdReader

from wayfi.frontends.measurements import Odometry
from wayfi.recordings.mcap.parts import parts_of
from wayfi.service.blackbox.disk import KINDS, MIB
from wayfi.service.daemon.estimator_process import CHECKPOINT_EVERY

RATE = 30.0  # times real time
BUDGET_MB = 20


def test_a_full_disk(minute: Simulated, tmp_path: Path) -> None:
    recording = write(tmp_path / "recording.mcap", minute.arrivals)
    with running(tmp_path / "runs") as daemon:
        daemon.collect("wayfi/pose")
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
        daemon.collect("wayfi/pose")
        daemon.publish(recording, 8.0)
        eventually(lambda: int(daemon.status()["unrecorded"]) > 0)
        daemon.settle()
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
        daemon.settle()
        assert daemon.stop() == 0, daemon.stderr
    assert not list(older.iterdir())
    parts, sessions = (parts_of(daemon.folder, kind) for kind in KINDS)
    assert len(parts) > 2
    assert len(sessions) > 1
    for session in sessions:
        assert RrdReader(session).stream().filter(content="/map/**").to_chunks(), session
    assert_nothing_vanished(daemon, recording)
    assert replays_alike(daemon.folder, tmp_path / "replayed")
