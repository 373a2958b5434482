"""The files of a drive: each is there and holds what it should."""

import csv
import hashlib
import json
import math
from pathlib import Path

import numpy as np
import pytest
from drives import RESULT_FILES, Replayed, Simulated, lines, run, write
from matplotlib.image import imread
from numpy.typing import NDArray
from rerun.chunk import RrdReader

from wayfi.frontends.measurements import LaserScan, Odometry, WifiScan
from wayfi.recordings.files.tables import CLOSURE_COLUMNS, RADIO_COLUMNS, read_closures
from wayfi.recordings.files.tum import read_tum
from wayfi.recordings.mcap.recording import open_recording
from wayfi.service.config import Config, config_toml, load_config

REPORT_KEYS = {
    *("messages", "dropped", "stages", "wall_s", "recording_s", "peak_memory_mb", "recording_sha256", "versions"),
    *("warnings", "status_changes", "floor"),
}
UNKNOWN, FREE, OCCUPIED = 128, 254, 0


def read_pgm(path: Path) -> NDArray[np.uint8]:
    """(rows, columns) greys of a binary PGM."""
    magic, size, most, data = path.read_bytes().split(b"\n", 3)
    assert (magic, most) == (b"P5", b"255")
    columns, rows = map(int, size.split())
    return np.frombuffer(data, np.uint8).reshape(rows, columns)


def read_map_yaml(path: Path) -> dict[str, str]:
    return dict(line.split(": ", 1) for line in lines(path))


def test_every_file_is_there(carpark_replay: Replayed) -> None:
    names = {path.name for path in carpark_replay.out.iterdir()}
    assert names == {*RESULT_FILES, "map"}
    assert (carpark_replay.out / "map" / "graph.g2o").read_bytes() == (carpark_replay.out / "graph.g2o").read_bytes()


def test_one_line_for_each_accepted_odometry_message_with_its_stamp(carpark_replay: Replayed) -> None:
    recording = open_recording(carpark_replay.simulated.recording)
    stamps = [record.log_time_ns for record in recording if record.topic == "/odom"]
    for name in ("trajectory.tum", "online.tum"):
        read = read_tum(carpark_replay.out / name)
        assert read.stamps_ns.tolist() == stamps
        assert all(len(line.split()) == 8 for line in lines(carpark_replay.out / name))
        assert all(len(line.split()[0].split(".")[1]) == 9 for line in lines(carpark_replay.out / name))
        np.testing.assert_array_equal(read.poses[0], 0.0)


def test_the_first_pose_is_the_origin_wherever_the_odometry_starts(minute: Simulated, tmp_path: Path) -> None:
    late = [a for a in minute.arrivals if a.second >= 20.0]
    run(write(tmp_path / "recording.mcap", late), tmp_path / "out")
    for name in ("trajectory.tum", "online.tum"):
        np.testing.assert_array_equal(read_tum(tmp_path / "out" / name).poses[0], 0.0)


def test_closures_have_their_columns_and_say_their_reasons(carpark_replay: Replayed) -> None:
    path = carpark_replay.out / "closures.csv"
    assert lines(path)[0] == ",".join(CLOSURE_COLUMNS)
    assert lines(path)[0] == (
        "stamp_a_ns,stamp_b_ns,kind,proposed_by,similarity,residual_m,inlier_ratio,dx_m,dy_m,dtheta_rad,"
        "cxx,cxy,cxt,cyy,cyt,ctt,verdict,reason"
    )
    rows = read_closures(path)
    assert any(row.verdict == "accepted" for row in rows)
    assert all(row.reason for row in rows)
    assert all(row.stamp_a_ns < row.stamp_b_ns for row in rows)
    accepted = [row for row in rows if row.verdict == "accepted" and row.heading_claimed]
    assert all(np.linalg.eigvalsh(row.covariance)[0] > 0 for row in accepted)


def test_the_map_is_what_nav2_reads(carpark_replay: Replayed) -> None:
    greys = read_pgm(carpark_replay.out / "map.pgm")
    about = read_map_yaml(carpark_replay.out / "map.yaml")
    assert about["image"] == "map.pgm"
    assert (float(about["occupied_thresh"]), float(about["free_thresh"])) == (0.65, 0.25)
    assert set(np.unique(greys)) == {OCCUPIED, FREE, UNKNOWN}
    assert imread(carpark_replay.out / "map.png").ndim == 3
    x, y = json.loads(about["origin"])[:2]
    columns, rows = (read_tum(carpark_replay.out / "trajectory.tum").poses[:, :2] - (x, y)).T / float(
        about["resolution"]
    )
    driven = greys[::-1][rows.astype(int), columns.astype(int)]
    assert (driven == FREE).mean() > 0.6  # straight ahead in a lane no beam comes back
    assert (driven == OCCUPIED).sum() == 0


def test_the_graph_has_every_keyframe_and_finite_edges(carpark_replay: Replayed) -> None:
    words = [line.split() for line in lines(carpark_replay.out / "graph.g2o")]
    vertices = {int(w[1]) for w in words if w[0] == "VERTEX_SE2"}
    edges = [w for w in words if w[0] == "EDGE_SE2"]
    assert vertices == set(range(len(vertices)))
    assert len(edges) >= len(vertices) - 1
    assert all({int(w[1]), int(w[2])} <= vertices for w in edges)
    assert all(math.isfinite(float(number)) for w in edges for number in w[3:])


def test_the_radio_map_holds_every_fingerprint_at_its_place(carpark_replay: Replayed) -> None:
    with (carpark_replay.out / "radio.csv").open(newline="") as file:
        rows = list(csv.reader(file))
    assert rows[0] == RADIO_COLUMNS
    places = np.array([row[1:3] for row in rows[1:]], float)
    assert np.isfinite(places).all()
    assert {row[3] for row in rows[1:]} == {"phone_a", "phone_b"}
    assert all(-120.0 <= float(row[5]) <= 0.0 for row in rows[1:])


def test_the_log_holds_every_stage(carpark_replay: Replayed) -> None:
    reader = RrdReader(carpark_replay.out / "session.rrd")
    roots = {chunk.entity_path.split("/")[1] for chunk in reader.stream().to_chunks() if chunk.entity_path != "/"}
    assert roots >= {"map", "wifi", "check", "backend", "log"}
    assert len(reader.blueprints()) == 1


def test_the_report_has_every_key(carpark_replay: Replayed) -> None:
    report = json.loads((carpark_replay.out / "report.json").read_text())
    assert report == carpark_replay.report
    assert set(report) == REPORT_KEYS
    assert report["messages"] == {"/tf_static": 1, "/odom": 3601, "/scan": 3600, "/wifi": 360}
    assert (report["dropped"], report["warnings"]) == ({}, [])
    assert report["recording_s"] == pytest.approx(360.0, abs=0.1)
    assert report["wall_s"] > 0
    assert report["peak_memory_mb"] > 10
    data = carpark_replay.simulated.recording.read_bytes()
    assert report["recording_sha256"] == hashlib.sha256(data).hexdigest()
    assert {"wayfi", "gtsam", "python"} <= set(report["versions"])
    assert {"decode", "process", "log", "map", "files"} <= set(report["stages"])
    for stage in report["stages"].values():
        assert 0 <= stage["p50_ms"] <= stage["p99_ms"] <= stage["max_ms"] <= stage["seconds"] * 1e3 + 1.0
    assert all(set(change) == {"stamp", "state", "reason", "failure_category"} for change in report["status_changes"])


def test_the_configuration_of_a_replay_gives_the_same_configuration(minute: Simulated, tmp_path: Path) -> None:
    recording = write(tmp_path / "recording.mcap", minute.arrivals[:300])
    run(recording, tmp_path / "out", "lidar.max_range_m=12.5", "wifi.enabled=false")
    kept = tmp_path / "out" / "config.toml"
    config = load_config([kept])
    assert (config.lidar.max_range_m, config.wifi.enabled) == (12.5, False)
    assert config_toml(config) == kept.read_text() != config_toml(Config())


def test_without_scans_the_grid_is_unknown_all_over(minute: Simulated, tmp_path: Path) -> None:
    run(write(tmp_path / "recording.mcap", minute.without(LaserScan)), tmp_path / "out", rrd=True)
    assert {path.name for path in (tmp_path / "out").iterdir()} == {*RESULT_FILES, "map"}
    greys = read_pgm(tmp_path / "out" / "map.pgm")
    assert greys.size > 0
    assert (greys == UNKNOWN).all()
    assert imread(tmp_path / "out" / "map.png").size > 0


def test_without_wifi_the_radio_map_is_its_header(minute: Simulated, tmp_path: Path) -> None:
    run(write(tmp_path / "recording.mcap", minute.without(WifiScan)), tmp_path / "out", rrd=True)
    assert {path.name for path in (tmp_path / "out").iterdir()} == {*RESULT_FILES, "map"}
    assert (tmp_path / "out" / "radio.csv").read_text() == ",".join(RADIO_COLUMNS) + "\n"


def test_the_shortest_drive_leaves_every_file(minute: Simulated, tmp_path: Path) -> None:
    first = [a for a in minute.arrivals if isinstance(a.measurement, Odometry)][:1]
    run(write(tmp_path / "recording.mcap", first), tmp_path / "out", rrd=True)
    assert {path.name for path in (tmp_path / "out").iterdir()} == {*RESULT_FILES, "map"}
    assert len(lines(tmp_path / "out" / "trajectory.tum")) == 1
    assert lines(tmp_path / "out" / "closures.csv") == [",".join(CLOSURE_COLUMNS)]
