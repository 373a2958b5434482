"""`wayfi.Slam` gives what a replay of the same messages gives, byte for byte."""

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from drives import RESULT_FILES, Arrival, Simulated, run, write
from places import ROOT
from streaming import stream

import wayfi
from wayfi.frontends.events import KeyframeAdded, PosePublished
from wayfi.recordings.simulation.run import start
from wayfi.recordings.simulation.spatial import spatial_measurements
from wayfi.recordings.simulation.worlds.blueprints import World

SAME = ("trajectory.tum", "online.tum", "closures.csv", "radio.csv", "graph.g2o", "calibration.toml", "config.toml")
T = 1_700_000_000_000_000_000
Message = tuple[int, tuple[float, float, float], list[float], dict[str, float]]


def assert_same(recording: Path, tmp_path: Path) -> None:
    """Replay and stream a recording; compare the files."""
    replayed = run(recording, tmp_path / "replayed")
    slam = wayfi.Slam()
    refused = stream(recording, slam)
    result = slam.finish()
    result.save(tmp_path / "streamed")
    for name in (*SAME, "map.pgm", "map.yaml"):
        assert (tmp_path / "streamed" / name).read_bytes() == (tmp_path / "replayed" / name).read_bytes(), name
    assert refused == 0
    assert {k: result.report[k] for k in ("messages", "dropped", "status_changes")} == {
        k: replayed[k] for k in ("messages", "dropped", "status_changes")
    }


def test_a_minute_streamed_is_the_minute_replayed(minute: Simulated, tmp_path: Path) -> None:
    assert_same(write(tmp_path / "recording.mcap", minute.arrivals), tmp_path)


def test_a_3d_lidar_streamed_is_the_same_replayed(tmp_path: Path) -> None:
    drive = start(World.CARPARK, 0, 0.25)
    arrivals = [Arrival(m.stamp_ns, m) for m in spatial_measurements(drive)]
    assert_same(write(tmp_path / "recording.mcap", arrivals), tmp_path)


@pytest.mark.parametrize("name", ["b14test1", "flat_calib3"])
def test_a_real_robot_streamed_is_the_same_replayed(name: str, real_data: Path, tmp_path: Path) -> None:
    recording = real_data / name / "recording.mcap"
    if not recording.exists():
        pytest.skip(f"the recording is not here: {recording}")
    assert_same(recording, tmp_path)


def robot() -> Iterator[Message]:
    """A robot that crosses a room of 12 x 8 m."""
    bearings = -3.14 + 0.0175 * np.arange(359)
    for i in range(40):
        x = 0.1 * i
        ahead = np.where(np.cos(bearings) > 0, 8.0 - x, 4.0 + x) / np.abs(np.cos(bearings))
        ranges = np.minimum(ahead, 4.0 / np.abs(np.sin(bearings)))
        yield T + i * 200_000_000, (x, 0.0, 0.0), ranges.tolist(), {"aa:bb:cc:dd:ee:ff": -61.0 + x}


def test_the_readme_s_example_works_as_it_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    found = re.search(r"## As a library\n.*?```python\n(.*?)```", (ROOT / "README.md").read_text(), re.DOTALL)
    assert found is not None
    exec(found[1], {"robot": robot()})
    printed = capsys.readouterr().out
    assert "Pose2(x=3.9" in printed
    assert "TRACKING" in printed
    assert {path.name for path in (tmp_path / "out").iterdir()} == {*RESULT_FILES, "map"} - {"session.rrd"}
    result = wayfi.load_result(tmp_path / "out")
    assert len(result.trajectory) == 40
    assert (result.grid.cells == 100).sum() > 100


def test_pose_covariance_and_state_are_those_of_the_newest_pose() -> None:
    slam = wayfi.Slam()
    assert (slam.pose, slam.covariance, slam.state, slam.grid) == (None, None, None, None)
    events = slam.add_odometry(T, 1.0, 2.0, 0.5)
    assert {type(event) for event in events} >= {KeyframeAdded, PosePublished}
    assert slam.pose == wayfi.Pose2(0.0, 0.0, 0.0)  # the first is the origin of the map
    slam.add_odometry(T + 10**9, 1.0 + 0.3 * np.cos(0.5), 2.0 + 0.3 * np.sin(0.5), 0.5)
    assert slam.pose is not None
    assert slam.pose.array() == pytest.approx([0.3, 0.0, 0.0], abs=1e-9)
    covariance = slam.covariance
    assert covariance is not None
    assert covariance.shape == (3, 3)
    assert np.linalg.eigvalsh(covariance)[0] > 0
    assert slam.state is wayfi.State.TRACKING
    covariance[:] = 0.0
    assert slam.covariance is not None
    assert slam.covariance.any()


def test_the_laser_leads_where_no_odometry_comes() -> None:
    slam = wayfi.Slam()
    for t_ns, _, ranges, _ in robot():
        slam.add_scan(t_ns, ranges, angle_min=-3.14, angle_increment=0.0175)
    assert slam.pose is not None
    assert slam.pose.x == pytest.approx(3.9, abs=0.1)


def test_a_mount_moves_what_the_laser_sees() -> None:
    walls = []
    for mount in ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)):
        slam = wayfi.Slam()
        slam.set_mount(mount)
        for t_ns, (x, y, theta), ranges, _ in robot():
            slam.add_odometry(t_ns, x, y, theta)
            slam.add_scan(t_ns, ranges, angle_min=-3.14, angle_increment=0.0175)
        result = slam.finish()
        assert result.report["warnings"] == []
        columns = np.nonzero(result.grid.cells == 100)[1]
        walls.append(result.grid.origin_xy_m[0] + result.grid.resolution_m * columns.max())
    assert walls[1] - walls[0] == pytest.approx(1.0, abs=0.1)
    assert walls[1] == walls[2]


def test_a_slam_that_has_finished_says_so() -> None:
    slam = wayfi.Slam()
    slam.add_odometry(T, 0.0, 0.0, 0.0)
    slam.finish()
    for use in (slam.finish, lambda: slam.add_odometry(T + 10**9, 0.0, 0.0, 0.0), lambda: slam.set_mount((0, 0, 0))):
        with pytest.raises(wayfi.FinishedError, match="this Slam has finished"):
            use()
    assert slam.pose == wayfi.Pose2()


def test_a_drive_of_nothing_finishes(tmp_path: Path) -> None:
    result = wayfi.Slam().finish()
    result.save(tmp_path / "a" / "b")
    assert len(result.trajectory) == 0
    assert (tmp_path / "a" / "b" / "trajectory.tum").read_text() == ""
    read = wayfi.load_result(tmp_path / "a" / "b")
    assert (len(read.trajectory), len(read.online), read.trajectory.poses.shape) == (0, 0, (0, 3))


def test_a_rerun_file_is_written_where_it_is_asked_for(tmp_path: Path) -> None:
    slam = wayfi.Slam(rrd=tmp_path / "drive.rrd")
    slam.add_odometry(T, 0.0, 0.0, 0.0)
    slam.finish()
    assert (tmp_path / "drive.rrd").stat().st_size > 1000


@pytest.mark.parametrize("path", ["nowhere/drive.rrd", "."])
def test_a_rerun_file_that_cannot_be_written_is_said_at_once(
    path: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(wayfi.ArgumentError, match="rrd: must be a file that can be written"):
        wayfi.Slam(rrd=path)


def test_a_rerun_file_that_fails_stops_no_drive(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    slam = wayfi.Slam(rrd=tmp_path / "drive.rrd")
    slam._rrd._log._process.kill()
    slam._rrd._log._process.wait()
    for t_ns, (x, y, theta), ranges, _ in robot():
        events = slam.add_odometry(t_ns, x, y, theta)
        assert any(isinstance(event, PosePublished) for event in events)
        slam.add_scan(t_ns, ranges, angle_min=-3.14, angle_increment=0.0175)
    assert slam.pose is not None
    assert slam.pose.x == pytest.approx(3.9, abs=0.1)
    report = slam.finish().report
    assert report["warnings"][0].startswith("rrd: the log ended early")
    assert caplog.text.count("the drive goes on without it") == 1


def test_a_calibration_is_taken_up(tmp_path: Path) -> None:
    wayfi.Slam().finish().save(tmp_path)
    text = (tmp_path / "calibration.toml").read_text()
    (tmp_path / "known.toml").write_text(re.sub(r"(turn_bias_rad_per_m = \{ ?value = )[^,]*", r"\g<1>0.02", text))
    result = wayfi.Slam(calibration=tmp_path / "known.toml").finish()
    assert 0.02 in result.calibration.wheels.values
