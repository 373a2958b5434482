"""A replay's folder of results: every file is there and parses, is the same again, and was known when it says so."""

import csv
import hashlib
import json
import math
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from conftest import Replayed
from drives import RESULT_FILES, Simulated, ate_m, lines, replay_by_cli, run, write
from matplotlib.image import imread
from numpy.typing import NDArray
from rerun.chunk import RrdReader

from wayfi.frontends.measurements import LaserScan, Odometry, StaticTransforms, WifiScan
from wayfi.recordings.files.tables import CLOSURE_COLUMNS, RADIO_COLUMNS, read_closures
from wayfi.recordings.files.tum import read_tum
from wayfi.recordings.mcap.recording import open_recording
from wayfi.recordings.mcap.writer import McapWriter
from wayfi.service.config import Config, config_toml, load_config

REPORT_KEYS = {
    *("messages", "dropped", "stages", "wall_s", "recording_s", "peak_memory_mb", "recording_sha256", "versions"),
    *("warnings", "status_changes"),
}
UNKNOWN, FREE, OCCUPIED = 128, 254, 0
CUTS = (1, 2, 3, 500, 4001, 6400)


def read_pgm(path: Path) -> NDArray[np.uint8]:
    """(rows, columns) greys of a binary PGM."""
    magic, size, most, data = path.read_bytes().split(b"\n", 3)
    assert (magic, most) == (b"P5", b"255")
    columns, rows = map(int, size.split())
    return np.frombuffer(data, np.uint8).reshape(rows, columns)


def read_map_yaml(path: Path) -> dict[str, str]:
    return dict(line.split(": ", 1) for line in lines(path))


def wheels_of(path: Path) -> dict[str, float]:
    """The values in a calibration.toml."""
    return {name: entry["value"] for name, entry in tomllib.loads(path.read_text())["wheels"].items()}


# The files


def test_every_file_is_there(carpark_replay: Replayed) -> None:
    names = {path.name for path in carpark_replay.out.iterdir()}
    assert names == {*RESULT_FILES, "map"}
    assert json.loads((carpark_replay.out / "map" / "map.json").read_text())["version"] == 1
    assert (carpark_replay.out / "map" / "graph.g2o").stat().st_size > 0


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
    assert all(set(change) == {"stamp", "state", "reason"} for change in report["status_changes"])


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


# The same again


def test_two_processes_give_the_same_bytes(carpark_replay: Replayed, tmp_path: Path) -> None:
    replay_by_cli(carpark_replay.simulated.recording, tmp_path, "--no-rrd")
    assert not (tmp_path / "session.rrd").exists()
    for name in set(RESULT_FILES) - {"session.rrd", "report.json"}:
        assert (tmp_path / name).read_bytes() == (carpark_replay.out / name).read_bytes(), name


def test_an_existing_folder_is_overwritten_file_by_file(minute: Simulated, tmp_path: Path) -> None:
    whole = write(tmp_path / "whole.mcap", minute.arrivals)
    part = write(tmp_path / "part.mcap", [a for a in minute.arrivals if a.second < 15.0])
    out, fresh = tmp_path / "out", tmp_path / "fresh"
    run(whole, out, rrd=True)
    (out / "mine.txt").write_text("keep me")
    run(part, out, rrd=True)
    run(part, fresh, rrd=True)
    for name in set(RESULT_FILES) - {"session.rrd", "report.json"}:
        assert (out / name).read_bytes() == (fresh / name).read_bytes(), name
    assert (out / "session.rrd").stat().st_size == pytest.approx((fresh / "session.rrd").stat().st_size, rel=0.05)
    assert {path.name for path in out.iterdir()} == {*RESULT_FILES, "map", "mine.txt"}
    assert (out / "mine.txt").read_text() == "keep me"


def test_rotated_parts_replay_as_one_file_does(minute: Simulated, tmp_path: Path) -> None:
    run(write(tmp_path / "whole.mcap", minute.arrivals), tmp_path / "whole")
    parts = tmp_path / "parts"
    parts.mkdir()
    for number in range(12):
        write(parts / f"part_{number}.mcap", [a for a in minute.arrivals if int(a.second / 5.1) == number])
    report = run(parts, tmp_path / "out")
    assert report["messages"] == {"/tf_static": 1, "/odom": 601, "/scan": 600, "/wifi": 60}
    for name in ("trajectory.tum", "online.tum", "closures.csv", "radio.csv", "map.pgm"):
        assert (tmp_path / "out" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes()


def test_wifi_in_json_replays_as_in_cdr(minute: Simulated, tmp_path: Path) -> None:
    in_json = [replace(a, encoding="json") if isinstance(a.measurement, WifiScan) else a for a in minute.arrivals]
    run(write(tmp_path / "cdr.mcap", minute.arrivals), tmp_path / "cdr")
    report = run(write(tmp_path / "json.mcap", in_json), tmp_path / "json")
    assert report["dropped"] == {}
    for name in ("trajectory.tum", "online.tum", "radio.csv"):
        assert (tmp_path / "json" / name).read_bytes() == (tmp_path / "cdr" / name).read_bytes()


def test_everything_in_json_replays_as_in_cdr(minute: Simulated, tmp_path: Path) -> None:
    first = [a for a in minute.arrivals if a.second < 12.0]
    run(write(tmp_path / "cdr.mcap", first), tmp_path / "cdr")
    run(write(tmp_path / "json.mcap", [replace(a, encoding="json") for a in first]), tmp_path / "json")
    for name in ("trajectory.tum", "online.tum"):  # JSON has the angles of beams in more digits than CDR's float32
        in_json, in_cdr = (read_tum(tmp_path / folder / name) for folder in ("json", "cdr"))
        assert in_json.stamps_ns.tolist() == in_cdr.stamps_ns.tolist()
        np.testing.assert_allclose(in_json.poses, in_cdr.poses, atol=1e-5)


# Known when it says it was


def first_messages(recording: Path, count: int, path: Path) -> Path:
    """The first `count` messages of a recording, as a recording."""
    with McapWriter(path) as writer:
        for number, record in enumerate(open_recording(recording)):
            if number < count:
                writer.write(record.topic, record.type_name, record.encoding, record.log_time_ns, record.data)
    return path


@pytest.mark.parametrize("count", CUTS)
def test_the_online_pose_knows_nothing_of_later_messages(carpark_replay: Replayed, tmp_path: Path, count: int) -> None:
    cut = first_messages(carpark_replay.simulated.recording, count, tmp_path / "cut.mcap")
    if not open_recording(cut).message_counts.get("/odom"):
        return
    report = run(cut, tmp_path / "out")
    online = lines(tmp_path / "out" / "online.tum")
    assert len(online) == report["messages"]["/odom"]
    assert online == lines(carpark_replay.out / "online.tum")[: len(online)]


def test_the_online_pose_knows_nothing_of_later_scans_where_the_laser_leads(minute: Simulated, tmp_path: Path) -> None:
    scans = minute.without(Odometry, WifiScan)
    run(write(tmp_path / "whole.mcap", scans), tmp_path / "whole")
    run(write(tmp_path / "cut.mcap", scans[:251]), tmp_path / "cut")
    online = lines(tmp_path / "cut" / "online.tum")
    assert len(online) == 250
    assert online == lines(tmp_path / "whole" / "online.tum")[:250]


def test_the_trajectory_knows_more_than_the_online_one(carpark_replay: Replayed) -> None:
    truth = read_tum(carpark_replay.simulated.truth)
    assert ate_m(carpark_replay.out, truth) < ate_m(carpark_replay.out, truth, "online.tum")


# Options


def test_a_sensor_switched_off_counts_as_if_it_were_not_there(minute: Simulated, tmp_path: Path) -> None:
    recording = write(tmp_path / "recording.mcap", minute.arrivals)
    for sensor, kinds in {"lidar": (LaserScan, StaticTransforms), "wifi": (WifiScan,)}.items():
        report = run(recording, tmp_path / sensor, f"{sensor}.enabled=false")
        run(write(tmp_path / "without.mcap", minute.without(*kinds)), tmp_path / "without")
        topic, count = {"lidar": ("/scan", 600), "wifi": ("/wifi", 60)}[sensor]
        assert report["dropped"] == {topic: {"sensor_off": count}}
        for name in ("trajectory.tum", "online.tum", "radio.csv"):
            assert (tmp_path / sensor / name).read_bytes() == (tmp_path / "without" / name).read_bytes()


def test_both_switched_off_leave_the_wheels(minute: Simulated, tmp_path: Path) -> None:
    recording = write(tmp_path / "recording.mcap", minute.arrivals)
    run(recording, tmp_path / "out", "lidar.enabled=false", "wifi.enabled=false")
    assert ate_m(tmp_path / "out", minute.truth) < 0.4


def test_the_calibration_of_an_earlier_drive_is_taken_up(
    carpark_replay: Replayed, minute: Simulated, tmp_path: Path
) -> None:
    earlier = carpark_replay.out / "calibration.toml"
    recording = write(tmp_path / "recording.mcap", minute.without(LaserScan, WifiScan))
    replay_by_cli(recording, tmp_path / "with", "--calibration", earlier, "--no-rrd")
    run(recording, tmp_path / "without")
    assert wheels_of(tmp_path / "with" / "calibration.toml") == pytest.approx(wheels_of(earlier), abs=1e-4)
    assert wheels_of(tmp_path / "without" / "calibration.toml") == pytest.approx(dict.fromkeys(wheels_of(earlier), 0))
    assert ate_m(tmp_path / "with", minute.truth) < 0.7 * ate_m(tmp_path / "without", minute.truth)


def test_a_rate_paces_the_replay(minute: Simulated, tmp_path: Path) -> None:
    recording = write(tmp_path / "recording.mcap", [a for a in minute.arrivals if a.second <= 30.0])
    report = replay_by_cli(recording, tmp_path / "paced", "--rate", "20", "--no-rrd")
    assert report["wall_s"] >= 30.0 / 20
    run(recording, tmp_path / "fast")
    assert (tmp_path / "paced/online.tum").read_bytes() == (tmp_path / "fast/online.tum").read_bytes()


def test_other_topics_can_be_named(minute: Simulated, tmp_path: Path) -> None:
    recording = write(tmp_path / "recording.mcap", minute.arrivals[:200])
    renamed = tmp_path / "renamed.mcap"
    with McapWriter(renamed) as writer:
        for r in open_recording(recording):
            topic = "/wheel/odometry" if r.topic == "/odom" else r.topic
            writer.write(topic, r.type_name, r.encoding, r.log_time_ns, r.data)
    run(recording, tmp_path / "plain")
    report = run(renamed, tmp_path / "renamed", "recording.odom=/wheel/odometry")
    assert "/wheel/odometry" in report["messages"]
    assert (tmp_path / "renamed/online.tum").read_bytes() == (tmp_path / "plain/online.tum").read_bytes()


def test_the_order_is_that_of_log_times_and_equal_ones_keep_the_files(minute: Simulated, tmp_path: Path) -> None:
    """The first messages, written from the last to the first: the log times bring them back into order."""
    first = minute.arrivals[:150]
    run(write(tmp_path / "forward.mcap", first), tmp_path / "forward")
    with McapWriter(tmp_path / "backward.mcap") as writer:
        for r in reversed(list(open_recording(tmp_path / "forward.mcap"))):
            writer.write(r.topic, r.type_name, r.encoding, r.log_time_ns, r.data)
    run(tmp_path / "backward.mcap", tmp_path / "backward")
    for name in ("trajectory.tum", "online.tum"):
        assert (tmp_path / "backward" / name).read_bytes() == (tmp_path / "forward" / name).read_bytes()
