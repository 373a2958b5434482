"""The daemon in a saved map: it publishes what it claims, which is right, and nothing before; a replay is the same."""

import json
import shutil
import subprocess
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from buildings.robots import drive
from buildings.storey import ROUTE, storey
from drives import Simulated, write
from live.daemons import LOSSLESS, Running, asked_for, message_of, running
from live.loopback import CLI, eventually
from live.runs import poses_of, recorded, replays_alike, report_of

from wayfi.frontends.measurements import SECOND_NS, Odometry
from wayfi.frontends.pipeline import Pipeline
from wayfi.recordings.files.tum import read_tum
from wayfi.recordings.map.loading import load_map
from wayfi.recordings.map.saving import save_map
from wayfi.recordings.mcap.recording import open_recording
from wayfi.recordings.ros.messages import OCCUPANCY_GRID
from wayfi.recordings.trajectory import Trajectory
from wayfi.service.blackbox.blackbox import MAP
from wayfi.service.config import load_config

RIGHT_M, RIGHT_RAD = 0.5, 0.1
ROUND = ((2.0, 7.5), (14.0, 7.5), (2.0, 7.5))
FASTER = 4.0  # than real time: the estimation keeps up beside another test


@pytest.fixture(scope="module")
def known(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of the map of the first day, whose first pose is its origin."""
    pipeline = Pipeline(load_config())
    for arrival in drive(storey(), ROUTE, day=0).arrivals:
        pipeline.process(arrival.measurement)
    folder = tmp_path_factory.mktemp("known") / "map"
    save_map(folder, pipeline.finish()[0].building)
    return folder


@pytest.fixture(scope="module")
def next_day() -> Simulated:
    """A drive of the next day, from another place on."""
    return drive(storey(), ROUTE[3:], day=1)


@pytest.fixture(scope="module")
def halves(next_day: Simulated, tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """The two halves of that drive as recordings."""
    folder, half = tmp_path_factory.mktemp("halves"), len(next_day.arrivals) // 2
    parts = (next_day.arrivals[:half], next_day.arrivals[half:])
    return [write(folder / f"{n}.mcap", part) for n, part in enumerate(parts)]


def errors(claimed: Trajectory, truth: Trajectory) -> tuple[np.ndarray, np.ndarray]:
    """How far the claimed poses are from the truth, m and rad; the map's origin is the first place of its drive."""
    true = truth.at(claimed.stamps_ns)
    x, y = ROUTE[0]
    metres = np.hypot(*(claimed.poses[:, :2] + (x, y) - true[:, :2]).T)
    return metres, np.abs(np.angle(np.exp(1j * (claimed.poses[:, 2] - true[:, 2]))))


@pytest.fixture(scope="module")
def ran(known: Path, halves: list[Path], tmp_path_factory: pytest.TempPathFactory) -> Running:
    """A daemon that has localised the next day's drive, the robot found before its second half."""
    folder = tmp_path_factory.mktemp("ran")
    with running(folder / "runs", LOSSLESS, "zenoh.ros=bridge", flags=("--map", str(known))) as daemon:
        daemon.collect("wayfi/pose", "wayfi/tf", "tf")
        eventually(lambda: asked_for(daemon.session, daemon.key("map")))
        daemon.samples["map"] = asked_for(daemon.session, daemon.key("map"))
        daemon.publish(halves[0], FASTER)
        eventually(lambda: poses_of(daemon) or daemon.status()["state"] == "TRACKING")
        daemon.publish(halves[1], FASTER)
        daemon.settle()
        assert daemon.stop() == 0, daemon.stderr
    return daemon


def test_the_map_is_published_before_the_robot_is_found(ran: Running, known: Path) -> None:
    grid = message_of(ran.samples["map"][0], OCCUPANCY_GRID)
    kept = load_map(known).building.grid
    assert (grid.info.height, grid.info.width) == kept.probability().shape
    assert grid.header.frame_id == "map"


def test_poses_are_published_once_they_are_claimed_and_are_right(ran: Running, next_day: Simulated) -> None:
    claimed = read_tum(ran.folder / "online.tum")
    metres, radians = errors(claimed, next_day.truth)
    assert metres.max() < RIGHT_M
    assert radians.max() < RIGHT_RAD
    first_s = (claimed.stamps_ns[0] - next_day.truth.stamps_ns[0]) / SECOND_NS
    assert 0.5 < first_s < 60.0
    published = {int(p.header.stamp.sec) * SECOND_NS + int(p.header.stamp.nanosec) for p in poses_of(ran)}
    assert min(published) >= claimed.stamps_ns[0]
    assert len(published) == len(poses_of(ran)) == len(claimed.stamps_ns)
    assert len(ran.samples["wayfi/tf"]) == len(ran.samples["tf"]) == len(published)


def test_the_run_has_no_map_of_its_own_and_names_the_one_it_is_in(ran: Running, known: Path) -> None:
    assert not (ran.folder / "map").exists()
    named = json.loads(open_recording(ran.folder).attachments()[MAP])
    assert named["path"] == str(known)
    assert named["map_id"] == load_map(known).map_id
    states = [change["state"] for change in report_of(ran.folder)["status_changes"]]  # each with its reasons
    assert list(dict.fromkeys(states))[:2] == ["RELOCALISING", "TRACKING"]


def test_its_replay_is_the_same_to_the_byte_or_says_which_map_it_misses(
    ran: Running, known: Path, tmp_path: Path
) -> None:
    assert replays_alike(ran.folder, tmp_path / "again")
    hidden = known.rename(known.with_name("hidden"))
    try:
        missed = _replayed(ran.folder, tmp_path / "missed")
        shutil.copytree(hidden, known)
        changed = (known / "manifest.json").read_text().replace('"map_version": 1', '"map_version": 2')
        (known / "manifest.json").write_text(changed)
        other = _replayed(ran.folder, tmp_path / "other")
        shutil.rmtree(known)
    finally:
        hidden.rename(known)
    for done in (missed, other):
        assert done.returncode == 1
        (line,) = done.stderr.strip().splitlines()
        assert f"{known}: does not hold the map" in line
        assert "of version 1 any more: put it back there" in line


def test_a_daemon_that_is_killed_goes_on_in_its_map(
    known: Path, next_day: Simulated, halves: list[Path], tmp_path: Path
) -> None:
    half = len(next_day.arrivals) // 2
    with running(tmp_path / "runs", LOSSLESS, flags=("--map", str(known))) as daemon:
        daemon.publish(halves[0], FASTER)
        eventually(lambda: recorded(daemon) == half)
        daemon.kill()
        daemon.start_again()
        daemon.publish(halves[1], FASTER)
        daemon.settle()
        assert daemon.stop() == 0, daemon.stderr
    assert len(daemon.lines("resumed")) == 1
    claimed = read_tum(daemon.folder / "online.tum")
    assert claimed.stamps_ns[-1] > next_day.arrivals[half].at_ns
    metres, _ = errors(claimed, next_day.truth)
    assert metres.max() < RIGHT_M
    assert replays_alike(daemon.folder, tmp_path / "again")


def _replayed(folder: Path, out: Path) -> "subprocess.CompletedProcess[str]":
    words = ["replay", str(folder), "--out", str(out), "--no-rrd", "--quiet"]
    return subprocess.run([*CLI, *words], capture_output=True, text=True, check=False)


def test_a_daemon_does_not_start_in_what_is_no_map(tmp_path: Path) -> None:
    done = subprocess.run([*CLI, "run", "--map", str(tmp_path)], capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "holds no map" in done.stderr


def test_the_mode_is_changed_on_the_way_and_back_in_the_map_made_so_far(tmp_path: Path) -> None:
    made = drive(storey(), [*ROUND, *ROUND[1:], *ROUND[1:]], day=2)
    cuts = np.linspace(0, len(made.arrivals), 4).astype(int)
    parts = [write(tmp_path / f"{n}.mcap", made.arrivals[a:b]) for n, (a, b) in enumerate(pairwise(cuts))]
    with running(tmp_path / "runs", LOSSLESS) as daemon:
        daemon.collect("wayfi/pose")
        assert not asked(daemon, "mode", "localization")["ok"]
        for part, mode in zip(parts, ("localization", "mapping", ""), strict=True):
            daemon.publish(part, FASTER)
            daemon.settle()
            if mode:
                assert asked(daemon, "mode", mode)["ok"]
                eventually(lambda mode=mode: daemon.status()["mode"] == mode)
        assert daemon.stop() == 0, daemon.stderr
    online, final = (read_tum(daemon.folder / name) for name in ("online.tum", "trajectory.tum"))
    assert len(online.stamps_ns) == made.count(Odometry) == len(poses_of(daemon))
    metres, radians = errors(final, made.truth)
    assert metres.max() < RIGHT_M
    assert radians.max() < RIGHT_RAD
    assert load_map(daemon.folder).building.keyframes
    assert {change["state"] for change in report_of(daemon.folder)["status_changes"]} <= {"TRACKING", "UNCERTAIN"}
    assert replays_alike(daemon.folder, tmp_path / "again")


def asked(daemon: Running, name: str, argument: str) -> dict[str, Any]:
    (answer,) = asked_for(daemon.session, f"{daemon.key(f'wayfi/command/{name}')}?{argument}")
    said: dict[str, Any] = json.loads(answer)
    return said
