"""The doctor: what `wayfi inspect` finds in recordings as people have them, and what it says to type."""

import json
import math
import shlex
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import wayfi
from drives import Arrival, Simulated, write
from faulty.fuzzed_drive import as_cloud, as_transforms, fuzzed, thinned
from ordinary_drives import renamed

from wayfi.frontends.measurements import (
    LaserScan,
    Odometry,
    Sensor,
    StaticTransforms,
    Transform,
    WifiScan,
)
from wayfi.recordings.mcap.recording import open_recording
from wayfi.recordings.mcap.writer import McapWriter
from wayfi.recordings.ros.messages import DEFAULT_TOPICS, LASER_SCAN, ODOMETRY, TYPE_OF_SENSOR
from wayfi.service.cli.inspection_text import lines_of
from wayfi.service.config import load_config
from wayfi.service.replay.diagnosis import Diagnosis, diagnose

LONG = "/a_fleet/with/long/namespaces/robot_0123456789/sensors/front/lidar_2d/scan_filtered_and_downsampled"


@pytest.fixture(scope="module")
def some(minute: Simulated) -> list[Arrival]:
    """Half a minute, in small messages."""
    return [replace(a, measurement=thinned(a.measurement)) for a in minute.arrivals if a.second <= 30.0]


def diagnosed(path: Path, *settings: str) -> Diagnosis:
    return diagnose(path, load_config((), settings), None)


def text_of(diagnosis: Diagnosis) -> str:
    """The text as one line, since lines are wrapped anywhere."""
    return " ".join(" ".join(lines_of(diagnosis)).split())


def changed(some: Iterable[Arrival], kind: type, how: Callable[[Arrival], Arrival]) -> list[Arrival]:
    return [how(a) if isinstance(a.measurement, kind) else a for a in some]


def on_topics(source: Path, path: Path, topics: dict[str, str]) -> Path:
    """The recording with other names of topics."""
    with McapWriter(path) as writer:
        for r in open_recording(source):
            writer.write(topics.get(r.topic, r.topic), r.type_name, r.encoding, r.log_time_ns, r.data)
    return path


def test_a_sound_recording_gets_a_verdict_and_the_command(some: list[Arrival], tmp_path: Path) -> None:
    found = diagnosed(write(tmp_path / "sound drive.mcap", some))
    assert found.usable
    assert found.verdict.startswith("This recording can be replayed: odometry at 10 Hz, a laser of ")
    assert "two WiFi receivers. Expect a map" in found.verdict
    assert shlex.split(found.command) == ["wayfi", "replay", str(tmp_path / "sound drive.mcap"), "--out", "result"]
    assert "!" not in text_of(found)


@pytest.mark.parametrize("columns", ["80", "40"])
def test_names_are_whole_at_80_columns(
    columns: str, some: list[Arrival], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", columns)
    monkeypatch.chdir(tmp_path)
    plain = write(tmp_path / "plain.mcap", some)
    done = wayfi("inspect", on_topics(plain, Path("long.mcap"), {"/scan": LONG}))
    assert done.exit_code == 0
    assert LONG in done.stdout
    assert "…" not in done.stdout
    assert all(len(line) <= 80 or LONG in line or "--out" in line for line in done.stdout.splitlines())


def test_json_holds_all_and_is_strict(some: list[Arrival], tmp_path: Path) -> None:
    done = wayfi("inspect", write(tmp_path / "a.mcap", some), "--json")
    found = json.loads(done.stdout)
    assert {"path", "duration_s", "message_count", "sha256", "usable", "topics", "warnings"} <= set(found)
    assert {"frames", "frame_faults", "trial", "verdict", "command"} <= set(found)
    by_topic = {topic["topic"]: topic for topic in found["topics"]}
    assert by_topic["/odom"]["odometry"]["path_m"] > 1.0
    assert by_topic["/scan"]["laser"]["beams"] == by_topic["/scan"]["beams"]
    assert set(by_topic["/wifi"]["wifi"]["scans"]) == {"phone_a", "phone_b"}
    assert abs(by_topic["/scan"]["clock"]["against_odometry_s"]) < 0.1
    assert found["trial"]["poses"] > 100


def test_what_cannot_be_used_exits_with_1_and_the_verdict(some: list[Arrival], tmp_path: Path) -> None:
    wifi = write(tmp_path / "wifi.mcap", [a for a in some if isinstance(a.measurement, WifiScan)])
    done = wayfi("inspect", wifi)
    assert (done.exit_code, len(done.stderr.splitlines())) == (1, 1)
    assert "cannot be replayed: it has neither odometry nor scans that can be read" in done.stderr
    as_json = wayfi("inspect", wifi, "--json")
    assert as_json.exit_code == 1
    found = json.loads(as_json.stdout)
    assert not found["usable"]
    assert found["error"] == found["verdict"]


def test_stamps_that_do_not_move_are_named_and_rates_are_by_log_time(some: list[Arrival], tmp_path: Path) -> None:
    still = changed(some, LaserScan, lambda a: renamed(a, stamp_ns=0))
    found = diagnosed(write(tmp_path / "a.mcap", still))
    (scan,) = found.inspection.of(Sensor.SCAN)
    assert scan.clock is not None
    assert scan.clock.still
    assert (scan.rate_hz, scan.rate_by) == (pytest.approx(10.0, rel=0.01), "log time")
    assert "all stamps are the same" in text_of(found)


@pytest.mark.parametrize("step_s", [-5.0, 3.0, 3600.0])
def test_a_clock_that_is_set_is_found_with_its_step(step_s: float, some: list[Arrival], tmp_path: Path) -> None:
    stepped = changed(some, LaserScan, lambda a: a.stamped(step_s) if a.second > 12.0 else a)
    found = diagnosed(write(tmp_path / "a.mcap", stepped))
    (scan,) = found.inspection.of(Sensor.SCAN)
    assert scan.clock is not None
    assert (scan.clock.steps, scan.clock.largest_step_s) == (1, pytest.approx(step_s, abs=0.01))
    (odometry,) = found.inspection.of(Sensor.ODOM)
    assert odometry.clock is not None
    assert odometry.clock.steps == 0
    assert "step against log time once" in text_of(found)


@pytest.mark.parametrize("ahead_s", [-2.0, 0.8, 40.0])
def test_clocks_are_told_against_the_odometrys(ahead_s: float, some: list[Arrival], tmp_path: Path) -> None:
    found = diagnosed(write(tmp_path / "a.mcap", changed(some, LaserScan, lambda a: a.stamped(ahead_s))))
    (scan,) = found.inspection.of(Sensor.SCAN)
    assert scan.clock is not None
    assert scan.clock.against_odometry_s == pytest.approx(ahead_s, abs=0.05)
    assert f"its clock is {'800 ms' if ahead_s == 0.8 else f'{abs(ahead_s):.1f} s'} " in text_of(found)


@pytest.mark.parametrize("times", [10.0, 3.0, 0.25])
def test_rates_are_right_where_the_recording_was_made_from_a_playback(
    times: float, some: list[Arrival], tmp_path: Path
) -> None:
    first_ns = some[0].at_ns
    played = [replace(a, at_ns=first_ns + round((a.at_ns - first_ns) / times)) for a in some]
    found = diagnosed(write(tmp_path / "a.mcap", played))
    (scan,) = found.inspection.of(Sensor.SCAN)
    assert scan.rate_hz == pytest.approx(10.0, rel=0.02)
    assert scan.clock is not None
    assert scan.clock.playback == pytest.approx(times, rel=0.05)
    assert scan.clock.steps == 0
    assert f"from a playback at {times:.3g} times real time" in text_of(found)
    assert "29.9 s by its stamps" in text_of(found)


@pytest.mark.parametrize("lies", ["chain", "broken", "none"])
def test_frames_are_a_tree_that_says_what_is_missing(lies: str, some: list[Arrival], tmp_path: Path) -> None:
    plate = Transform("/base_link", "plate", (0.2, 0.0, 0.1), (0.0, 0.0, 0.0, 1.0))
    laser = Transform("plate" if lies == "chain" else "arm", "laser", (0.1, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0))
    transforms = () if lies == "none" else (plate, laser)
    said = changed(some, StaticTransforms, lambda a: renamed(a, transforms=transforms))
    found = diagnosed(write(tmp_path / "a.mcap", said))
    frames = {frame.frame: frame for frame in found.inspection.frames}
    assert frames["laser"].of == "laser"
    if lies == "chain":
        assert [(f.frame, f.depth) for f in found.inspection.frames] == [("base_link", 0), ("plate", 1), ("laser", 2)]
        assert frames["laser"].mount == pytest.approx((0.3, 0.0, math.pi))
        assert not found.inspection.frame_faults
    else:
        assert frames["laser"].mount is None
        assert "'laser'" in found.inspection.frame_faults[0]
        assert "laser (a laser's): not joined to the base" in text_of(found)


def test_odometry_shows_its_twist_its_sources_and_its_stillness(some: list[Arrival], tmp_path: Path) -> None:
    at = next(a.measurement.pose for a in some if isinstance(a.measurement, Odometry))
    still = changed(some, Odometry, lambda a: renamed(a, pose=at, twist=(0.5, 0.0, 0.0)))
    (twist,) = diagnosed(write(tmp_path / "a.mcap", still)).inspection.of(Sensor.ODOM)
    assert twist.odometry is not None
    assert twist.odometry.path_m == 0.0
    assert twist.odometry.twist_path_m == pytest.approx(15.0, abs=0.2)
    assert twist.odometry.longest_still_s == pytest.approx(30.0, abs=0.2)
    others = [renamed(a, child_frame_id="chassis").delayed(0.03) for a in some if isinstance(a.measurement, Odometry)]
    two = diagnosed(write(tmp_path / "b.mcap", [*some, *others]))
    (both,) = two.inspection.of(Sensor.ODOM)
    assert both.odometry is not None
    assert both.odometry.child_frames == {"base_link": 300, "chassis": 300}
    assert both.rate_hz == pytest.approx(10.0, rel=0.01)
    assert "poses of several frames" in text_of(two)


@pytest.mark.parametrize("fault", ["degrees", "increment", "sweep"])
def test_lasers_show_what_cannot_be_true(fault: str, some: list[Arrival], tmp_path: Path) -> None:
    def wrong(a: Arrival) -> Arrival:
        scan: Any = a.measurement
        if fault == "sweep":
            return renamed(a, time_increment_s=1.0 / len(scan.ranges))
        in_degrees = {"angle_min": math.degrees(scan.angle_min), "angle_increment": math.degrees(scan.angle_increment)}
        return renamed(a, **(in_degrees if fault == "degrees" else {"angle_increment": 0.0}))

    said = text_of(diagnosed(write(tmp_path / "a.mcap", changed(some, LaserScan, wrong))))
    assert {"degrees": "is in degrees", "increment": "! angle_increment", "sweep": "a sweep is said to take"}[
        fault
    ] in said


@pytest.mark.parametrize("fault", ["per cent", "BSSIDs"])
def test_wifi_of_which_nothing_can_be_used_is_not_promised(fault: str, some: list[Arrival], tmp_path: Path) -> None:
    def wrong(a: Arrival) -> Arrival:
        scan: Any = a.measurement
        if fault == "per cent":
            return renamed(a, rssi=np.asarray(scan.rssi + 120.0, np.float32))
        return renamed(a, bssids=tuple(f"station {number}" for number in range(len(scan.bssids))))

    found = diagnosed(write(tmp_path / "a.mcap", changed(some, WifiScan, wrong)))
    assert "WiFi receiver" not in found.verdict
    assert "Of /wifi nothing is used" in found.verdict
    assert {"per cent": "absurd_rssi", "BSSIDs": "malformed_bssid, such as 'station "}[fault] in text_of(found)


def test_clouds_outside_of_the_band_lead_to_the_settings(some: list[Arrival], tmp_path: Path) -> None:
    low = [replace(a, measurement=as_cloud(a.measurement)) if isinstance(a.measurement, LaserScan) else a for a in some]
    flat = changed(low, type(low[[isinstance(a.measurement, LaserScan) for a in some].index(True)].measurement), _flat)
    found = diagnosed(write(tmp_path / "a.mcap", flat))
    (cloud,) = found.inspection.of(Sensor.POINTS)
    assert cloud.cloud is not None
    assert cloud.cloud.in_band == 0.0
    assert "Of /points nothing is used" in found.verdict
    assert "--set lidar.cloud.low_m=" in found.command


def _flat(a: Arrival) -> Arrival:
    cloud: Any = a.measurement
    return renamed(a, points=(cloud.points * [1.0, 1.0, 0.0] - [0.0, 0.0, 3.0]).astype(np.float32))


def test_odometry_on_tf_alone_is_told_as_such(some: list[Arrival], tmp_path: Path) -> None:
    on_tf = changed(some, Odometry, lambda a: replace(a, measurement=as_transforms(a.measurement)))
    found = diagnosed(write(tmp_path / "a.mcap", on_tf))
    assert "can be replayed: odometry from /tf, a laser of" in found.verdict
    assert "led by the laser" not in found.verdict


def test_odometry_in_an_unknown_encoding_is_refused_with_the_reason(some: list[Arrival], tmp_path: Path) -> None:
    with McapWriter(tmp_path / "a.mcap") as writer:
        writer.write("/odom", ODOMETRY, "protobuf", some[0].at_ns, b"pose")
        writer.write("/scan", LASER_SCAN, "cdr", some[0].at_ns, b"\0\1\0\0scan")
    found = diagnosed(tmp_path / "a.mcap")
    assert not found.usable
    assert "/odom: unknown encoding protobuf" in found.verdict
    assert "/scan: " in found.verdict


@pytest.mark.parametrize("names", [("/robot1/scan",), ("/front", "/rear")])
def test_topics_that_are_found_or_chosen_are_shown(names: tuple[str, ...], some: list[Arrival], tmp_path: Path) -> None:
    path = on_topics(write(tmp_path / "a.mcap", some), tmp_path / "b.mcap", {"/scan": names[0]})
    if len(names) > 1:
        with McapWriter(tmp_path / "c.mcap") as writer:
            for number, r in enumerate(open_recording(path)):
                topic = names[1] if r.topic == names[0] and number % 3 == 0 else r.topic
                writer.write(topic, r.type_name, r.encoding, r.log_time_ns, r.data)
        path = tmp_path / "c.mcap"
    found = diagnosed(path)
    assert [topic.topic for topic in found.inspection.of(Sensor.SCAN)] == [names[0]]
    assert ("--set recording.scan=/front" in found.command) == (len(names) > 1)
    assert any(names[-1] in warning for warning in found.inspection.warnings)


def test_undecodable_messages_have_their_reasons_and_the_options_are_kept(some: list[Arrival], tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with McapWriter(path) as writer:
        for r in open_recording(write(tmp_path / "sound.mcap", some)):
            writer.write(r.topic, r.type_name, r.encoding, r.log_time_ns, r.data)
        for number in range(6):
            writer.write("/odom", ODOMETRY, "cdr", some[-1].at_ns + number, b"\0\1\0\0" + bytes(number))
        writer.write("/front", LASER_SCAN, "protobuf", some[-1].at_ns, b"")
    done = wayfi("inspect", path, "--set", "lidar.max_range_m=12.5")
    (odometry,) = diagnosed(path).inspection.of(Sensor.ODOM)
    assert odometry.undecodable == 6
    assert odometry.reasons
    assert sum(odometry.reasons.values()) <= 6
    assert "! cannot be decoded" in done.stdout
    assert done.stdout.rstrip().endswith("--out result --set lidar.max_range_m=12.5")
    assert "unknown encoding protobuf" in " ".join(done.stdout.split())


@pytest.mark.filterwarnings("ignore::RuntimeWarning")  # where numbers overflow, infinity is the answer
@pytest.mark.parametrize("seed", [1, 2])
def test_no_content_makes_the_doctor_fail(seed: int, some: list[Arrival], tmp_path: Path) -> None:
    sound = [a.measurement for a in some]
    sound += [as_cloud(m) for m in sound[:100] if isinstance(m, LaserScan)]
    sound += [as_transforms(m) for m in sound[:100] if isinstance(m, Odometry)]
    with McapWriter(tmp_path / "a.mcap") as writer:
        for number, fed in enumerate(fuzzed(sound, 2500, seed=seed)):
            writer.write(DEFAULT_TOPICS[fed.sensor], TYPE_OF_SENSOR[fed.sensor], fed.encoding, number * 10**8, fed.data)
    found = diagnosed(tmp_path / "a.mcap")
    json.dumps(found.to_dict(), allow_nan=False)
    assert text_of(found)
