"""Messages lost, repeated, late or missing for a minute, clocks that jump: every pose comes, replays are alike."""

import random
from collections.abc import Iterable
from pathlib import Path

import pytest
from drives import Arrival, Simulated, ate_m, run, write
from live.daemons import Running, running
from live.runs import assert_every_pose, assert_nothing_vanished, drops, poses_of, replays_alike

from wayfi.frontends.events import DropReason
from wayfi.frontends.measurements import LaserScan, Measurement, Odometry, WifiScan
from wayfi.frontends.odometry.odometry_config import ClockConfig
from wayfi.recordings.trajectory import Trajectory

RATE = 10.0  # times real time
SHARE = 0.05
LATE_S = 0.5
CLOSE_M = 0.2
WHEELS_M = 0.5  # after a minute on wheels that wander: 1.5 % of 30 m
JUMP_S = 10.0


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
        daemon.collect("wayfi/pose")
        daemon.publish(recording, RATE)
        daemon.settle()
        assert daemon.stop() == 0, daemon.stderr
    assert_nothing_vanished(daemon, recording)
    assert replays_alike(daemon.folder, tmp_path / "replayed")
    return daemon


def of_all_m(tmp_path: Path, truth: Trajectory) -> float:
    """ATE RMSE, m, with all that was published: at this rate a daemon on a busy machine drops scans."""
    run(tmp_path / "recording.mcap", tmp_path / "all")
    return ate_m(tmp_path / "all", truth)


def test_messages_lost_sent_twice_and_late(minute: Simulated, tmp_path: Path) -> None:
    daemon = driven(tmp_path, mangled(minute.arrivals, seed=1))
    assert_every_pose(daemon)
    assert {DropReason.DUPLICATE, DropReason.STAMP_BACK} <= set(drops(daemon, "/odom"))
    assert of_all_m(tmp_path, minute.truth) < CLOSE_M


@pytest.mark.parametrize("kind", [Odometry, LaserScan, WifiScan])
def test_a_sensor_silent_for_a_minute(longer: Simulated, tmp_path: Path, kind: type[Measurement]) -> None:
    daemon = driven(tmp_path, silent(longer.arrivals, kind))
    assert_every_pose(daemon)
    assert of_all_m(tmp_path, longer.truth) < (WHEELS_M if kind is LaserScan else CLOSE_M)


def test_clocks_that_jump(minute: Simulated, tmp_path: Path) -> None:
    daemon = driven(tmp_path, jumping(minute.arrivals))
    assert_every_pose(daemon, overtaken=ClockConfig().lasting_messages, restamped=ClockConfig().lasting_messages)
    assert drops(daemon, "/odom") == {DropReason.STAMP_BACK: ClockConfig().lasting_messages - 1}


def test_all_of_it_at_once(longer: Simulated, tmp_path: Path) -> None:
    daemon = driven(tmp_path, mangled(jumping(silent(longer.arrivals, WifiScan)), seed=2))
    assert_every_pose(daemon, overtaken=ClockConfig().lasting_messages, restamped=ClockConfig().lasting_messages)
    assert len(poses_of(daemon)) > 0.8 * longer.count(Odometry)
