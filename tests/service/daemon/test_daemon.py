"""The daemon as a process on loopback, from the first message to the last file."""

import json
import math
import signal
import subprocess
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import zenoh
from live.daemons import LOSSLESS, Running, message_of, odometry, running
from live.loopback import CLI, eventually
from live.runs import (
    odometry_of,
    pose_of,
    poses_of,
    recorded,
    stamp_ns,
)
from places import REAL_DATA

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.measurements import Sensor, StaticTransforms
from wayfi.recordings.files.tum import read_tum
from wayfi.recordings.mcap.recording import open_recording
from wayfi.recordings.mcap.writer import McapWriter
from wayfi.recordings.ros.codec import decode
from wayfi.recordings.ros.messages import (
    OCCUPANCY_GRID,
)
from wayfi.recordings.ros.topics import CONTROL_TOPIC, Encoding
from wayfi.recordings.simulation.recorder import simulate
from wayfi.recordings.simulation.worlds.blueprints import World
from wayfi.service.transport.message_queue import QueueDrop

FILES = {
    "trajectory.tum",
    "online.tum",
    "session_0001.rrd",
    "blackbox_0001.mcap",
    "closures.csv",
    "map.pgm",
    "map.yaml",
    "map.png",
    "graph.g2o",
    "radio.csv",
    "report.json",
    "config.toml",
    "calibration.toml",
    "map",
}
CUT_S = 60
LEFT = 60  # messages that a stop finds waiting: a busy machine feeds them, too, in the 3 s that it has for them


def cut(recording: Path, out: Path, seconds: float) -> Path:
    source = open_recording(recording)
    end_ns = source.start_ns + round(seconds * 1e9)
    with McapWriter(out) as writer:
        for r in source:
            if r.log_time_ns <= end_ns:
                writer.write(r.topic, r.type_name, r.encoding, r.log_time_ns, r.data)
    return out


def carpark(folder: Path) -> Path:
    return simulate(World.CARPARK, folder / "carpark", seed=4, minutes=CUT_S / 60).recording


def real_walk(folder: Path) -> Path:
    recording = REAL_DATA / "b14test1" / "recording.mcap"
    if not recording.exists():
        pytest.skip(f"the real recordings are not at {REAL_DATA}")
    return cut(recording, folder / "b14test1.mcap", CUT_S)


@dataclass
class Drive:
    """The recording that a daemon received, the daemon, and its exit code."""

    recording: Path
    daemon: Running
    exit_code: int


@pytest.fixture(scope="module", params=[carpark, real_walk])
def drive(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Drive]:
    folder = tmp_path_factory.mktemp("drive")
    recording = request.param(folder)
    with running(folder / "runs", LOSSLESS) as daemon:
        daemon.collect("wayfi/pose", "wayfi/tf", "wayfi/map")
        daemon.publish(recording, None)
        count = len(odometry_of(recording))
        eventually(lambda: len(daemon.samples["wayfi/pose"]) >= count)
        daemon.settle(LEFT)
        exit_code = daemon.stop()
        eventually(lambda: daemon.samples["wayfi/map"])
        yield Drive(recording, daemon, exit_code)


def test_it_ends_cleanly_with_every_file(drive: Drive) -> None:
    assert drive.exit_code == 0, drive.daemon.stderr
    assert {path.name for path in drive.daemon.folder.iterdir()} == FILES
    assert all(json.loads(line)["level"] in ("info", "warning") for line in drive.daemon.stderr.splitlines())


def test_one_pose_for_each_odometry_message_with_its_stamp(drive: Drive) -> None:
    poses = poses_of(drive.daemon)
    assert [stamp_ns(p.header) for p in poses] == [m.stamp_ns for m in odometry_of(drive.recording)]
    assert {p.header.frame_id for p in poses} == {"map"}
    online = read_tum(drive.daemon.folder / "online.tum").poses
    assert np.allclose([[pose_of(p).x, pose_of(p).y] for p in poses], online[:, :2], atol=1e-8)


def test_the_covariance_is_that_of_a_planar_pose(drive: Drive) -> None:
    for message in poses_of(drive.daemon):
        covariance = message.pose.covariance.reshape(6, 6)[np.ix_((0, 1, 5), (0, 1, 5))]
        assert np.isfinite(covariance).all()
        assert (np.linalg.eigvalsh((covariance + covariance.T) / 2) > -1e-12).all()


def test_tf_leads_from_the_odometry_to_the_pose(drive: Drive) -> None:
    odometry, poses = odometry_of(drive.recording), poses_of(drive.daemon)
    assert len(drive.daemon.samples["wayfi/tf"]) == len(poses)
    for data, sent, pose in zip(drive.daemon.samples["wayfi/tf"], odometry, poses, strict=True):
        transforms = decode(data, Sensor.TF_STATIC, Encoding.CDR)
        assert isinstance(transforms, StaticTransforms)
        (t,) = transforms.transforms
        assert (transforms.stamp_ns, t.frame_id, t.child_frame_id) == (sent.stamp_ns, "map", "odom")
        T_map_odom = Pose2(t.translation_xyz[0], t.translation_xyz[1], 2 * math.atan2(*t.rotation_xyzw[2:]))
        T_map_base = T_map_odom @ sent.pose
        assert T_map_base.distance(pose_of(pose)) < 1e-6
        assert abs(T_map_base.between(pose_of(pose)).theta) < 1e-6


def test_nothing_is_lost_on_the_way(drive: Drive) -> None:
    report = json.loads((drive.daemon.folder / "report.json").read_text())
    assert report["messages"] == dict(open_recording(drive.recording).message_counts)
    assert {reason for reasons in report["dropped"].values() for reason in reasons}.isdisjoint(QueueDrop)
    assert set(report["latency"]) == {"p50_ms", "p99_ms", "max_ms"}


def test_the_status_has_state_rates_queues_and_latencies(drive: Drive) -> None:
    status = drive.daemon.status()
    assert status["state"] in ("TRACKING", "UNCERTAIN", "LOST")
    assert int(status["poses"]) == len(odometry_of(drive.recording))
    assert status["run"] == str(drive.daemon.folder)
    assert {"rate_hz./odom", "queue./odom", "queue./scan", "latency.p50_ms", "latency.max_ms"} <= set(status)


def test_the_map_is_the_saved_one(drive: Drive) -> None:
    message = message_of(drive.daemon.samples["wayfi/map"][-1], OCCUPANCY_GRID)
    greys = (drive.daemon.folder / "map.pgm").read_bytes().split(b"\n", 3)[3]
    rows, columns = message.info.height, message.info.width
    saved = np.frombuffer(greys, np.uint8).reshape(rows, columns)[::-1]
    published = np.asarray(message.data).reshape(rows, columns)
    assert np.array_equal(published == 100, saved == 0)
    assert np.array_equal(published == 0, saved == 254)
    assert set(np.unique(published)) <= {-1, 0, 100}


def test_the_black_box_replays_to_the_same_bytes(drive: Drive, tmp_path: Path) -> None:
    command = [*CLI, "replay", str(drive.daemon.folder), "--out", str(tmp_path), "--no-rrd", "--quiet"]
    subprocess.run(command, check=True, timeout=120)
    for name in ("trajectory.tum", "online.tum", "config.toml"):
        assert (tmp_path / name).read_bytes() == (drive.daemon.folder / name).read_bytes(), name


def test_the_black_box_holds_what_was_published_in_its_order(drive: Drive) -> None:
    blackbox = open_recording(drive.daemon.folder)
    assert blackbox.is_blackbox
    fed = [(r.topic, r.data) for r in blackbox if r.topic != CONTROL_TOPIC]
    assert fed == [(r.topic, r.data) for r in open_recording(drive.recording)]


def test_json_and_garbage_and_a_kill(tmp_path: Path) -> None:
    with running(tmp_path / "runs") as daemon:
        daemon.collect("wayfi/pose")
        put = partial(daemon.session.put, congestion_control=zenoh.CongestionControl.BLOCK)
        for number in range(10):
            put(daemon.key("odom"), odometry(number, Encoding.JSON), encoding=zenoh.Encoding.APPLICATION_JSON)
        for garbage in (b"", b"\x00", b"{", bytes(5000)):
            put(daemon.key("odom"), garbage, encoding=zenoh.Encoding.APPLICATION_JSON)
            put(daemon.key("scan"), garbage)
        put(daemon.key("odom"), bytes(1 << 20))
        put(daemon.key("odom"), odometry(10))
        eventually(lambda: len(daemon.samples["wayfi/pose"]) == 11)
        expected = {
            "dropped./odom.undecodable": "4",
            "dropped./odom.too_large": "1",
            "dropped./scan.undecodable": "4",
            "poses": "11",
        }
        eventually(lambda: expected.items() <= daemon.status().items())
        eventually(lambda: recorded(daemon) == 19)
        daemon.process.kill()
        daemon.process.wait()
        fed = [record for record in open_recording(daemon.folder) if record.topic != CONTROL_TOPIC]
        assert Counter(record.topic for record in fed) == {"/odom": 15, "/scan": 4}
        assert [record.encoding for record in fed][:10] == ["json"] * 10


def test_a_stop_at_once_leaves_every_file(tmp_path: Path) -> None:
    with running(tmp_path / "runs") as daemon:
        assert daemon.stop(signal.SIGINT) == 0, daemon.stderr
        assert {path.name for path in daemon.folder.iterdir()} == FILES


def test_without_rerun_there_is_no_log(tmp_path: Path) -> None:
    with running(tmp_path / "runs", "rerun.enabled=false") as daemon:
        assert daemon.stop() == 0, daemon.stderr
        assert {path.name for path in daemon.folder.iterdir()} == FILES - {"session_0001.rrd"}
