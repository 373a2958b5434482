"""What goes wrong around a daemon: it stays up, publishes a pose for every odometry message, and replays alike."""

import random
from collections.abc import Iterable
from pathlib import Path

import pytest
from daemons import Running, assert_replays_alike, poses_of, report_of, running
from drives import Arrival, Simulated, simulated, write

from wayfi.backend.scoring import absolute_error
from wayfi.backend.trajectory import Trajectory
from wayfi.frontends.events import DropReason
from wayfi.frontends.measurements import LaserScan, Measurement, Odometry, WifiScan
from wayfi.frontends.timebase import LASTING_MESSAGES
from wayfi.recordings.mcap_log import open_recording
from wayfi.recordings.simulation.worlds import World
from wayfi.recordings.tum import read_tum
from wayfi.service.queues import QueueDrop
from wayfi.service.tally import merged

RATE = 30.0  # times real time
SHARE = 0.05
LATE_S = 0.5
CLOSE_M = 0.2
JUMP_S = 10.0


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
    assert_replays_alike(daemon.folder, tmp_path / "replayed")
    return daemon


def assert_nothing_vanished(daemon: Running, recording: Path) -> None:
    """Every message was fed, or is counted as one that the queues dropped."""
    report = report_of(daemon.folder)
    unfed = {t: sum(n for why, n in whys.items() if why in set(QueueDrop)) for t, whys in report["dropped"].items()}
    assert merged({"": report["messages"]}, {"": unfed})[""] == open_recording(recording).message_counts


def assert_every_pose(daemon: Running, overtaken: int = 0) -> None:
    """Every odometry message that was not dropped for a reason gave a pose, but for so many that came too late."""
    used = report_of(daemon.folder)["messages"]["/odom"] - sum(drops(daemon, "/odom").values())
    kept = len(read_tum(daemon.folder / "online.tum").poses)
    assert used <= kept
    assert kept - overtaken <= len(poses_of(daemon)) <= kept


def drops(daemon: Running, topic: str) -> dict[str, int]:
    """How many messages were dropped, by reason."""
    reasons: dict[str, int] = report_of(daemon.folder)["dropped"].get(topic, {})
    return reasons


def ate_m(daemon: Running, truth: Trajectory) -> float:
    return absolute_error(read_tum(daemon.folder / "trajectory.tum"), truth).error.ate_rmse_m


def test_messages_lost_sent_twice_and_late(minute: Simulated, tmp_path: Path) -> None:
    daemon = driven(tmp_path, mangled(minute.arrivals, seed=1))
    assert_every_pose(daemon)
    assert {DropReason.DUPLICATE, DropReason.STAMP_BACK} <= set(drops(daemon, "/odom"))
    assert ate_m(daemon, minute.truth) < CLOSE_M


@pytest.mark.parametrize("kind", [Odometry, LaserScan, WifiScan])
def test_a_sensor_silent_for_a_minute(longer: Simulated, tmp_path: Path, kind: type[Measurement]) -> None:
    daemon = driven(tmp_path, silent(longer.arrivals, kind))
    assert_every_pose(daemon)
    assert ate_m(daemon, longer.truth) < CLOSE_M


def test_clocks_that_jump(minute: Simulated, tmp_path: Path) -> None:
    daemon = driven(tmp_path, jumping(minute.arrivals))
    assert_every_pose(daemon, overtaken=LASTING_MESSAGES)
    assert drops(daemon, "/odom") == {DropReason.STAMP_BACK: LASTING_MESSAGES - 1}


def test_all_of_it_at_once(longer: Simulated, tmp_path: Path) -> None:
    daemon = driven(tmp_path, mangled(jumping(silent(longer.arrivals, WifiScan)), seed=2))
    assert_every_pose(daemon, overtaken=LASTING_MESSAGES)
    assert len(poses_of(daemon)) > 0.8 * longer.count(Odometry)
