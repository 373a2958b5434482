"""Poses based on earlier estimates, and drives that resume from a checkpoint."""

import math
import pickle
import subprocess
import sys
from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from wayfi.backend.pose2 import Pose2, diagonal_covariance
from wayfi.frontends.closures.vetoes import VETOED
from wayfi.frontends.events import Dropped, Event, Verdict, Warned
from wayfi.frontends.measurements import MovingTransforms, Odometry, PoseFix, Sensor, Transform
from wayfi.frontends.pipeline import Pipeline
from wayfi.frontends.result import DriveEstimate
from wayfi.recordings.files.tum import read_tum
from wayfi.recordings.log import NullLog
from wayfi.recordings.mcap.blocks import Record
from wayfi.recordings.mcap.recording import open_recording
from wayfi.recordings.ros.codec import decode, encode
from wayfi.recordings.ros.messages import POSE_WITH_COVARIANCE, TF_MESSAGE
from wayfi.recordings.ros.topics import CONTROL_TOPIC, Encoding
from wayfi.recordings.simulation.recorder import simulate
from wayfi.recordings.simulation.worlds.blueprints import World
from wayfi.recordings.trajectory import Trajectory
from wayfi.service.blackbox.checkpoint import read_checkpoint, write_checkpoint
from wayfi.service.config import Config
from wayfi.service.drive.control_records import ControlKind, ControlRecord
from wayfi.service.drive.drive import Drive
from wayfi.service.drive.live_drive import LiveDrive
from wayfi.service.evaluation.trajectory_scores import absolute_error
from wayfi.service.replay.replayers import BlackBoxReplayer, PlainReplayer


def control(kind: ControlKind, number: int = 0, text: str = "") -> Record:
    return Record(CONTROL_TOPIC, "", "json", 0, ControlRecord(kind, number, text).to_json())


class Daemon:
    """Feeds as a daemon does whose estimation is `behind` messages late; keeps what its black box would hold."""

    def __init__(self, behind: int) -> None:
        self.replayer = BlackBoxReplayer(LiveDrive(Config(), None, NullLog()))
        self.blackbox: list[Record] = []
        self._known: deque[tuple[int, int]] = deque()
        self._behind = behind
        self._newest = 0

    def feed(self, record: Record) -> None:
        """Feed one message, after what has become known of the earlier ones."""
        number = len(self.blackbox)
        while self._known and self._known[0][0] + self._behind <= number:
            self.play(control(ControlKind.ADOPT, self._known.popleft()[1]))
        self.play(record)
        newest = self.replayer.live.newest
        if newest != self._newest:
            self._newest = newest
            self._known.append((len(self.blackbox), newest))

    def play(self, record: Record) -> None:
        """Play a record, and keep it."""
        self.blackbox.append(record)
        self.replayer.play(record)


def played(records: Iterable[Record]) -> DriveEstimate:
    replayer = BlackBoxReplayer(LiveDrive(Config(), None, NullLog()))
    for record in records:
        replayer.play(record)
    return replayer.drive.finish()


def same(one: DriveEstimate, other: DriveEstimate) -> bool:
    return all(
        np.array_equal(a, b)
        for a, b in (
            (one.stamps_ns, other.stamps_ns),
            (one.online, other.online),
            (one.final, other.final),
            (one.building.grid.probability(), other.building.grid.probability()),
        )
    )


@dataclass(frozen=True, slots=True)
class Recorded:
    """The records of a drive, and the truth of it."""

    records: list[Record]
    truth: Trajectory


def recorded(folder: Path, minutes: float, points: bool = False) -> Recorded:
    made = simulate(World.OFFICE, folder, minutes=minutes, points=points)
    return Recorded(list(open_recording(made.recording)), read_tum(made.truth))


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Recorded:
    return recorded(tmp_path_factory.mktemp("office"), 2.0)


# 300 messages are 30 s, in which wheels that err by 3.5 % go 0.5 m wrong at 0.5 m/s, until they are calibrated
@pytest.mark.parametrize(("behind", "worse_m"), [(0, 0.05), (10, 0.05), (300, 0.15)])
def test_poses_on_earlier_estimates_are_nearly_as_good(drive: Recorded, behind: int, worse_m: float) -> None:
    daemon = Daemon(behind)
    plain = PlainReplayer(Drive(Config(), None, NullLog()))
    for record in drive.records:
        daemon.feed(record)
        plain.play(record)
    live, zero = daemon.replayer.drive.finish(), plain.drive.finish()
    assert np.array_equal(live.final, zero.final)
    assert np.array_equal(live.stamps_ns, zero.stamps_ns)
    errors = [absolute_error(Trajectory(r.stamps_ns, r.online), drive.truth).error.ate_rmse_m for r in (live, zero)]
    assert errors[0] < errors[1] + worse_m
    assert not np.array_equal(live.online, zero.online)


def test_the_black_box_gives_the_same_drive(drive: Recorded) -> None:
    daemon = Daemon(37)
    for number, record in enumerate(drive.records):
        daemon.feed(record)
        if number % 700 == 699:
            daemon.play(control(ControlKind.CHECKPOINT, number))
        if number == 1500:
            daemon.play(control(ControlKind.AWAY, 1000))
    assert same(played(daemon.blackbox), daemon.replayer.drive.finish())


def with_fixes(drive: Recorded) -> Iterator[Record]:
    """A fix of the true pose now and then, which becomes a closure."""
    first = Pose2.of(drive.truth.poses[0])
    for number, record in enumerate(drive.records):
        yield record
        if record.topic == "/odom" and number % 150 == 100:
            odometry = decode(record.data, Sensor.ODOM, Encoding.CDR)
            true = Pose2.of(drive.truth.at(np.array([odometry.stamp_ns]))[0])
            fix = PoseFix(odometry.stamp_ns, first.between(true), diagonal_covariance(0.3, 0.2))
            yield record._replace(topic="/fix", type_name=POSE_WITH_COVARIANCE, data=encode(fix))


def test_vetoes_and_restores_replay_to_the_same_drive(drive: Recorded) -> None:
    """Of a closure that is part of the map, and of some that are not, which changes nothing."""
    daemon = Daemon(37)
    for number, record in enumerate(with_fixes(drive)):
        daemon.feed(record)
        verdicts = daemon.replayer.drive.counters.verdicts
        accepted = [n for n, v in verdicts.items() if v.verdict is Verdict.ACCEPTED]
        if number % 400 == 399:
            for closure in [*accepted[-2:], 10_000]:
                daemon.play(control(ControlKind.COMMAND, closure, "veto"))
        if number % 1200 == 1199:
            daemon.play(control(ControlKind.CHECKPOINT, number))
            daemon.play(control(ControlKind.COMMAND, min(verdicts, default=0), "restore"))
    vetoed = [v for v in daemon.replayer.drive.counters.verdicts.values() if v.reason == VETOED]
    live = daemon.replayer.drive.finish()
    assert vetoed
    assert live.building.vetoed == {v.closure for v in vetoed}
    assert all(live.building.closures[v.closure].factors for v in vetoed)
    assert same(played(daemon.blackbox), live)


def with_transforms(records: list[Record]) -> Iterator[Record]:
    """Odometry in /tf all the time, and messages of it now and then."""
    for number, record in enumerate(records):
        if record.topic != "/odom":
            yield record
            continue
        odometry = decode(record.data, Sensor.ODOM, Encoding.CDR)
        assert isinstance(odometry, Odometry)
        T, half = odometry.pose, 0.5 * odometry.pose.theta
        pose = Transform("odom", "base_link", (T.x, T.y, 0.0), (0.0, 0.0, math.sin(half), math.cos(half)))
        moved = MovingTransforms(odometry.stamp_ns, (pose,), (odometry.stamp_ns,))
        yield record._replace(topic="/tf", type_name=TF_MESSAGE, data=encode(moved))
        if number // 500 % 2:
            yield record


def test_the_black_box_gives_the_same_drive_where_tf_leads_now_and_then(drive: Recorded) -> None:
    daemon = Daemon(37)
    for number, record in enumerate(with_transforms(drive.records)):
        daemon.feed(record)
        if number % 700 == 699:
            daemon.play(control(ControlKind.CHECKPOINT, number))
    live = daemon.replayer.drive.finish()
    assert same(played(daemon.blackbox), live)
    assert len(live.stamps_ns) > 1150
    error = absolute_error(Trajectory(live.stamps_ns, live.final), drive.truth).error
    assert error.ate_rmse_m < 0.05
    texts = daemon.replayer.drive.counters.warnings
    assert any("it is taken from /tf" in text for text in texts)
    assert any("not /tf" in text for text in texts)


RESUME = """
import pickle, sys
from pathlib import Path
from test_live_drive import played_on
sys.stdout.buffer.write(pickle.dumps(played_on(Path(sys.argv[1]))))
"""


def played_on(folder: Path) -> tuple[bytes, bytes]:
    """Go on from the checkpoint in `folder` with the records beside it."""
    checkpoint = read_checkpoint(folder)
    assert checkpoint is not None
    replayer = BlackBoxReplayer(LiveDrive.restored(checkpoint.drive, NullLog()))
    for record in pickle.loads((folder / "records").read_bytes()):
        replayer.play(record)
    result = replayer.drive.finish()
    return result.online.tobytes(), result.final.tobytes()


@pytest.mark.parametrize("points", [False, True])
def test_another_process_resumes_from_a_checkpoint_with_the_same_result(tmp_path: Path, points: bool) -> None:
    records = recorded(tmp_path / "drive", 1.0, points).records
    half = len(records) // 2
    replayer = BlackBoxReplayer(LiveDrive(Config(), None, NullLog()))
    for record in records[:half]:
        replayer.play(record)
    write_checkpoint(tmp_path, 7, replayer.live.checkpoint(7))
    (tmp_path / "records").write_bytes(pickle.dumps(records[half:]))
    done = subprocess.run(
        [sys.executable, "-c", RESUME, str(tmp_path)],
        cwd=Path(__file__).parent,
        capture_output=True,
        check=True,
        timeout=200,
    )
    for record in records[half:]:
        replayer.play(record)
    result = replayer.drive.finish()
    assert pickle.loads(done.stdout) == (result.online.tobytes(), result.final.tobytes())
    assert len(result.stamps_ns) > 100


def test_an_internal_error_is_reported_and_the_drive_goes_on(drive: Recorded, monkeypatch: pytest.MonkeyPatch) -> None:
    sound, count = Pipeline.process, 0

    def failing(self: Pipeline, *arguments: object) -> list[Event]:
        nonlocal count
        count += 1
        if count == 500:
            raise RuntimeError("out of luck")
        return sound(self, *arguments)  # type: ignore[arg-type]

    monkeypatch.setattr(Pipeline, "process", failing)
    replayer = BlackBoxReplayer(LiveDrive(Config(), None, NullLog()))
    for record in drive.records[:1000]:
        replayer.play(record)
    counters = replayer.drive.counters
    assert [reasons["internal_error"] for reasons in counters.dropped.values()] == [1]
    assert any("out of luck" in text for text in counters.warnings)
    assert len(replayer.drive.finish().stamps_ns) > 400


def test_a_message_that_cannot_be_decoded_is_an_event_and_the_first_of_a_topic_says_why() -> None:
    live = LiveDrive(Config(), None, NullLog())
    first, published = live.feed(Sensor.WIFI, Encoding.JSON, b'{"readings": []}')
    assert published is None
    assert [(type(e), e.text if isinstance(e, Warned) else "") for e in first] == [
        (Dropped, ""),
        (Warned, "/wifi: cannot be decoded: header.stamp.sec is missing"),
    ]
    live.drive.show(first)
    again, _ = live.feed(Sensor.WIFI, Encoding.JSON, b"{")
    assert [type(e) for e in again] == [Dropped]
