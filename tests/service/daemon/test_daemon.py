"""The daemon and its companions as processes on loopback, from the first message to the last file."""

import json
import math
import signal
import socket
import subprocess
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zenoh
from daemons import (
    CLI,
    Running,
    asked_for,
    eventually,
    free_port,
    into,
    message_of,
    odometry,
    odometry_of,
    pose_of,
    poses_of,
    running,
    stamp_ns,
)
from places import REAL_DATA
from zenoh.ext import HistoryConfig, declare_advanced_subscriber

from wayfi.backend.graph.wheel_calibration import WheelCalibration
from wayfi.backend.grid.map_config import MapConfig
from wayfi.backend.pose2 import Pose2
from wayfi.frontends.calibration import Calibration
from wayfi.frontends.events import GridRedrawn
from wayfi.frontends.measurements import Sensor, StaticTransforms
from wayfi.frontends.wifi.receivers import ReceiverOffset
from wayfi.recordings.files.calibration_file import write_calibration
from wayfi.recordings.files.tum import read_tum
from wayfi.recordings.mcap.recording import McapWriter, open_recording
from wayfi.recordings.ros.codec import decode
from wayfi.recordings.ros.messages import (
    NS_PER_S,
    OCCUPANCY_GRID,
    ODOMETRY,
)
from wayfi.recordings.ros.topics import CONTROL_TOPIC, Encoding
from wayfi.recordings.simulation.recorder import simulate
from wayfi.recordings.simulation.worlds import World
from wayfi.service.blackbox.blackbox import BlackBox
from wayfi.service.config import Config, ZenohConfig, load_config
from wayfi.service.replay import publish
from wayfi.service.replay.publish import PublishError, has_subscriber, publish_recording
from wayfi.service.replay.replay import settings_for
from wayfi.service.transport.output_messages import map_message
from wayfi.service.transport.publishers import Publishers
from wayfi.service.transport.queues import QueueDrop, Received
from wayfi.service.transport.zenoh_session import ZenohError, key_of, open_guest_session, open_session

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


# A whole drive


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
    """What a daemon was given, what it said, and what it left."""

    recording: Path
    daemon: Running
    exit_code: int


@pytest.fixture(scope="module", params=[carpark, real_walk])
def drive(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Drive]:
    folder = tmp_path_factory.mktemp("drive")
    recording = request.param(folder)
    with running(folder / "runs", "zenoh.scan_queue=100000") as daemon:
        daemon.collect("wayfi/pose", "wayfi/tf", "wayfi/status", "wayfi/map")
        daemon.publish(recording, None)
        count = len(odometry_of(recording))
        eventually(lambda: len(daemon.samples["wayfi/pose"]) >= count)
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
    for data, said, pose in zip(drive.daemon.samples["wayfi/tf"], odometry, poses, strict=True):
        transforms = decode(data, Sensor.TF_STATIC, Encoding.CDR)
        assert isinstance(transforms, StaticTransforms)
        (t,) = transforms.transforms
        assert (transforms.stamp_ns, t.frame_id, t.child_frame_id) == (said.stamp_ns, "map", "odom")
        T_map_odom = Pose2(t.translation_xyz[0], t.translation_xyz[1], 2 * math.atan2(*t.rotation_xyzw[2:]))
        T_map_base = T_map_odom @ said.pose
        assert T_map_base.distance(pose_of(pose)) < 1e-6
        assert abs(T_map_base.between(pose_of(pose)).theta) < 1e-6


def test_nothing_is_lost_on_the_way(drive: Drive) -> None:
    report = json.loads((drive.daemon.folder / "report.json").read_text())
    assert report["messages"] == dict(open_recording(drive.recording).message_counts)
    assert {reason for reasons in report["dropped"].values() for reason in reasons}.isdisjoint(QueueDrop)
    assert set(report["latency"]) == {"p50_ms", "p99_ms", "max_ms"}


def test_the_status_tells_state_rates_queues_and_latencies(drive: Drive) -> None:
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


# What comes in


def test_json_and_garbage_and_a_kill(tmp_path: Path) -> None:
    with running(tmp_path / "runs") as daemon:
        daemon.collect("wayfi/pose", "wayfi/status")
        put = partial(daemon.session.put, congestion_control=zenoh.CongestionControl.BLOCK)
        for number in range(10):
            put(daemon.key("odom"), odometry(number, Encoding.JSON), encoding=zenoh.Encoding.APPLICATION_JSON)
        for garbage in (b"", b"\x00", b"{", bytes(5000)):
            put(daemon.key("odom"), garbage, encoding=zenoh.Encoding.APPLICATION_JSON)
            put(daemon.key("scan"), garbage)
        put(daemon.key("odom"), bytes(1 << 20))
        put(daemon.key("odom"), odometry(10))
        eventually(lambda: len(daemon.samples["wayfi/pose"]) == 11)
        told = {
            "dropped./odom.undecodable": "4",
            "dropped./odom.too_large": "1",
            "dropped./scan.undecodable": "4",
            "poses": "11",
        }
        eventually(lambda: told.items() <= daemon.status().items())
        time.sleep(1.0)  # what a kill may cost
        daemon.process.kill()
        daemon.process.wait()
        kept = open_recording(daemon.folder)
        fed = [record for record in kept if record.topic != CONTROL_TOPIC]
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


def test_a_port_in_use_is_one_line(tmp_path: Path) -> None:
    with socket.socket() as holder:
        holder.bind(("127.0.0.1", 0))
        holder.listen()
        port = holder.getsockname()[1]
        words = ["--set", f"zenoh.listen=['tcp/127.0.0.1:{port}']", "--set", f"recording.directory={tmp_path}/runs"]
        done = subprocess.run([*CLI, "run", *words], capture_output=True, text=True, timeout=60)
    assert done.returncode == 1
    (line,) = done.stderr.splitlines()
    assert str(port) in line
    assert "in use" in line
    assert not (tmp_path / "runs").exists()


def test_a_directory_that_cannot_be_written_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    words = [
        *("--set", f"zenoh.listen=['tcp/127.0.0.1:{free_port()}']", "--set", f"rerun.port={free_port()}"),
        *("--set", f"recording.directory={tmp_path / 'file' / 'runs'}"),
    ]
    done = subprocess.run([*CLI, "run", *words], capture_output=True, text=True, timeout=120)
    assert done.returncode == 1
    (line,) = done.stderr.splitlines()
    assert line.startswith(f"wayfi: {tmp_path}/file/runs")
    assert "cannot be written" in line


@pytest.mark.parametrize("setting", ["zenoh.no_key=1", "zenoh.security.password=secret", "zenoh.odom_queue=0"])
def test_a_setting_that_is_none_is_one_line(setting: str) -> None:
    done = subprocess.run([*CLI, "run", "--set", setting], capture_output=True, text=True, timeout=60)
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert line.startswith(f"wayfi: {setting.partition('=')[0]}: ")


# Late joiners


def test_a_late_joiner_gets_the_map() -> None:
    config = ZenohConfig(listen=[f"tcp/127.0.0.1:{free_port()}"])
    grids = [
        GridRedrawn(0, np.full((2, 2), 0.5, np.float32), 0.05, (0.0, 0.0)),
        GridRedrawn(7 * NS_PER_S, np.array([[0.1, 0.5, 0.9]], np.float32), 0.05, (-1.0, 2.0)),
    ]
    with open_session(config) as session, Publishers(session, config) as publishers:
        for grid in grids:
            publishers.publish_map(map_message(grid, MapConfig()))
        with open_guest_session(config) as late:
            eventually(lambda: map_message(grids[1], MapConfig()) in asked_for(late, "wayfi/map"))
            asked = asked_for(late, "wayfi/map")
            seen: list[bytes] = []
            history = HistoryConfig(max_samples=1, detect_late_publishers=True)
            with declare_advanced_subscriber(late, "wayfi/map", into(seen.append), history=history):
                eventually(lambda: seen)
    assert asked == seen == [map_message(grids[1], MapConfig())]
    message = message_of(asked[0], OCCUPANCY_GRID)
    assert message.data.tolist() == [0, -1, 100]
    assert (message.info.width, message.info.height, stamp_ns(message.header)) == (3, 1, 7 * NS_PER_S)
    assert (message.info.origin.position.x, message.info.origin.position.y) == (-1.0, 2.0)


# Companions


def test_what_is_recorded_is_what_was_published(tmp_path: Path) -> None:
    recording, out = tmp_path / "in.mcap", tmp_path / "out.mcap"
    with McapWriter(recording) as writer:
        for number in range(50):
            writer.write("/odom", ODOMETRY, "cdr", number * 100_000_000, odometry(number))
    config = ZenohConfig(listen=[f"tcp/127.0.0.1:{free_port()}"])
    settings = ["--set", f"zenoh.listen={config.listen}"]
    with (
        open_session(config) as session,
        subprocess.Popen([*CLI, "record", "--out", str(out), "--quiet", *settings]) as recorder,
    ):
        publisher = session.declare_publisher("odom")
        eventually(lambda: has_subscriber(publisher))
        summary = publish_recording(recording, Config(zenoh=config), None)
        recorder.send_signal(signal.SIGINT)
        assert recorder.wait(timeout=30) == 0
    assert summary.messages == {"/odom": 50}
    assert [(r.topic, r.data) for r in open_recording(out)] == [(r.topic, r.data) for r in open_recording(recording)]


def test_publishing_to_nobody_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with McapWriter(tmp_path / "in.mcap") as writer:
        writer.write("/odom", ODOMETRY, "cdr", 0, odometry(0))
    monkeypatch.setattr(publish, "WAIT_S", 0.3)
    config = Config(zenoh=ZenohConfig(listen=[f"tcp/127.0.0.1:{free_port()}"]))
    with pytest.raises(PublishError, match="nobody listens at tcp/127"):
        publish_recording(tmp_path / "in.mcap", config, None)


@pytest.mark.parametrize("change", [{"mode": "star"}, {"listen": ["nonsense"]}, {"listen": ["tcp/127.0.0.1:99999"]}])
def test_what_zenoh_does_not_take_is_one_line(change: dict[str, Any]) -> None:
    with pytest.raises(ZenohError) as caught:
        open_session(ZenohConfig(**change))
    assert "\n" not in str(caught.value)
    assert ".rs:" not in str(caught.value)


def test_a_prefix_that_makes_no_key_is_one_line() -> None:
    with pytest.raises(ZenohError, match=r"zenoh\.prefix"):
        key_of(ZenohConfig(prefix="a//b"), "odom")


# The black box's own settings


def test_a_replay_takes_the_black_boxs_settings_unless_told_otherwise(tmp_path: Path) -> None:
    config = load_config((), ["lidar.enabled=false", "recording.odom=/wheels"])
    calibration = Calibration(
        WheelCalibration(np.array([0.1, 0.2, 0.3, 1 / 3]), np.array([1.0, 2.0, 3.0, 1e-7])),
        {"tablet": ReceiverOffset(0.0, 0.0), "phone": ReceiverOffset(-2.5, 1 / 3)},
    )
    with BlackBox(tmp_path, config, config.recording.topics, calibration) as blackbox:
        blackbox.write(Received(Sensor.ODOM, Encoding.CDR, odometry(0), time.monotonic()))
    again, kept = settings_for(tmp_path, (), (), None)
    assert again == config
    assert kept is not None
    assert np.array_equal(kept.wheels.values, calibration.wheels.values)
    assert np.array_equal(kept.wheels.sigmas, calibration.wheels.sigmas)
    assert list(kept.receivers.items()) == list(calibration.receivers.items())
    write_calibration(tmp_path / "mine.toml", Calibration(WheelCalibration(np.zeros(4), np.ones(4)), {}))
    told, mine = settings_for(tmp_path, (), ["lidar.enabled=true"], tmp_path / "mine.toml")
    assert told.lidar.enabled
    assert told.recording.odom == "/wheels"
    assert mine is not None
    assert not mine.wheels.values.any()


def test_guests_that_come_and_go_leave_no_memory_behind() -> None:
    config = ZenohConfig(listen=[f"tcp/127.0.0.1:{free_port()}"])
    with open_session(config):
        before = Path("/proc/self/maps").read_text().count("/dev/shm/")
        for _ in range(3):
            with open_guest_session(config) as guest:
                for _ in range(200):
                    guest.put("x", bytes(100_000), congestion_control=zenoh.CongestionControl.BLOCK)
        assert Path("/proc/self/maps").read_text().count("/dev/shm/") == before
