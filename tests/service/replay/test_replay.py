"""A replay is the same again, knows nothing of later messages, and follows its options."""

import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from drives import RESULT_FILES, Replayed, Simulated, ate_m, lines, replay_by_cli, run, write

from wayfi.frontends.measurements import LaserScan, Odometry, StaticTransforms, WifiScan
from wayfi.recordings.files.tum import read_tum
from wayfi.recordings.mcap.recording import open_recording
from wayfi.recordings.mcap.writer import McapWriter

CUTS = (1, 2, 3, 500, 4001, 6400)


def wheels_of(path: Path) -> dict[str, float]:
    """The values in a calibration.toml."""
    return {name: entry["value"] for name, entry in tomllib.loads(path.read_text())["wheels"].items()}


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
    no_axes = "odometry.axes.enabled=false"  # then nothing more is learnt of the wheels
    replay_by_cli(recording, tmp_path / "with", "--calibration", earlier, "--no-rrd", "--set", no_axes)
    run(recording, tmp_path / "without", no_axes)
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
