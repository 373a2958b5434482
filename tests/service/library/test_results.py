"""A result is the same from a Slam, from a replay, and read again from its folder."""

import pickle
import threading
from pathlib import Path

import numpy as np
import pytest
from drives import RESULT_FILES, Simulated, write
from streaming import hand_in, stream

import wayfi
from wayfi.recordings.files.tables import CLOSURE_COLUMNS
from wayfi.recordings.simulation.recorder import SimulatedRecording


@pytest.fixture(scope="module")
def recording(minute: Simulated, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write(tmp_path_factory.mktemp("minute") / "recording.mcap", minute.arrivals)


@pytest.fixture(scope="module")
def replayed(recording: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[wayfi.Result, Path]:
    out = tmp_path_factory.mktemp("replayed") / "out"
    return wayfi.replay(recording, out), out


@pytest.fixture(scope="module")
def carpark_streamed(
    carpark: SimulatedRecording, tmp_path_factory: pytest.TempPathFactory
) -> tuple[wayfi.Result, Path]:
    """Six minutes with closures, by a Slam; and where they are saved."""
    slam, out = wayfi.Slam(), tmp_path_factory.mktemp("streamed")
    stream(carpark.recording, slam)
    result = slam.finish()
    result.save(out)
    return result, out


def test_a_replay_writes_every_file_and_returns_what_is_in_them(replayed: tuple[wayfi.Result, Path]) -> None:
    result, out = replayed
    assert {path.name for path in out.iterdir()} == {*RESULT_FILES, "map"}
    assert len(result.trajectory) == len(result.online) == 601
    assert result.report["messages"]["/odom"] == 601
    assert set(np.unique(result.grid.cells)) == {-1, 0, 100}
    assert result.calibration.wheels.values.shape == (4,)
    assert set(result.calibration.receivers) == {"phone_a", "phone_b"}


def test_a_result_that_was_read_is_saved_as_it_is(replayed: tuple[wayfi.Result, Path], tmp_path: Path) -> None:
    result, out = replayed
    result.save(str(tmp_path / "copy"))
    assert {p.name: p.read_bytes() for p in out.iterdir() if p.is_file()} == {
        p.name: p.read_bytes() for p in (tmp_path / "copy").iterdir() if p.is_file()
    }
    result.save(out)
    assert len(wayfi.load_result(out).trajectory) == 601


def test_a_result_may_be_pickled(replayed: tuple[wayfi.Result, Path], minute: Simulated, tmp_path: Path) -> None:
    slam = wayfi.Slam()
    for arrival in minute.arrivals[:200]:
        hand_in(arrival.measurement, slam)
    for name, result in (("read", replayed[0]), ("streamed", slam.finish())):
        again = pickle.loads(pickle.dumps(result))
        np.testing.assert_array_equal(again.trajectory.poses, result.trajectory.poses)
        result.save(tmp_path / name / "once")
        again.save(tmp_path / name / "again")
        for file in ("trajectory.tum", "closures.csv", "map.pgm", "graph.g2o"):
            once, twice = (tmp_path / name / folder / file for folder in ("once", "again"))
            assert once.read_bytes() == twice.read_bytes()


def test_settings_configuration_and_calibration_are_taken(
    recording: Path, replayed: tuple[wayfi.Result, Path], tmp_path: Path
) -> None:
    (tmp_path / "robot.toml").write_text("[lidar]\nmax_range_m = 20.0\n")
    calibration = replayed[1] / "calibration.toml"
    settings = {"wifi.enabled": False, "lidar.min_points": 31}
    out = tmp_path / "out"
    result = wayfi.replay(recording, out, tmp_path / "robot.toml", rrd=False, calibration=calibration, **settings)
    assert not (out / "session.rrd").exists()
    assert result.report["dropped"] == {"/wifi": {"sensor_off": 60}}
    config = (out / "config.toml").read_text()
    assert "max_range_m = 20.0" in config
    assert "min_points = 31" in config


def test_a_replay_may_run_in_any_thread(recording: Path, tmp_path: Path) -> None:
    thread = threading.Thread(target=lambda: wayfi.replay(recording, tmp_path / "out", rrd=False))
    thread.start()
    thread.join()
    assert len(wayfi.load_result(tmp_path / "out").trajectory) == 601


def test_a_slam_s_closures_are_those_in_its_file(carpark_streamed: tuple[wayfi.Result, Path]) -> None:
    result, out = carpark_streamed
    read = wayfi.load_result(out)
    assert len(result.closures) == len(read.closures) > 0
    for ours, theirs in zip(result.closures, read.closures, strict=True):
        assert (ours.stamp_a_ns, ours.stamp_b_ns, ours.kind, ours.verdict, ours.reason) == (
            *(theirs.stamp_a_ns, theirs.stamp_b_ns, theirs.kind, theirs.verdict, theirs.reason),
        )
        np.testing.assert_allclose(ours.T_a_b.array(), theirs.T_a_b.array(), atol=1e-6)
        np.testing.assert_allclose(ours.covariance, theirs.covariance, rtol=1e-5)
    np.testing.assert_array_equal(result.grid.cells, read.grid.cells)
    np.testing.assert_allclose(result.trajectory.poses[:, :2], read.trajectory.poses[:, :2], atol=1e-8)


@pytest.mark.parametrize("missing", ["trajectory.tum", "closures.csv", "map.pgm", "calibration.toml", "report.json"])
def test_a_file_that_is_missing_or_another_is_said(
    missing: str, replayed: tuple[wayfi.Result, Path], tmp_path: Path
) -> None:
    replayed[0].save(tmp_path)
    (tmp_path / missing).unlink()
    with pytest.raises(wayfi.WayfiError, match=missing):
        wayfi.load_result(tmp_path)
    (tmp_path / missing).write_text("P5 nonsense {")
    with pytest.raises(wayfi.WayfiError):
        wayfi.load_result(tmp_path)


def test_a_folder_that_cannot_be_made_is_said(tmp_path: Path) -> None:
    (tmp_path / "file").write_text(",".join(CLOSURE_COLUMNS))
    with pytest.raises(wayfi.ResultError, match="cannot be written"):
        wayfi.Slam().finish().save(tmp_path / "file" / "out")
    with pytest.raises(wayfi.WayfiError, match=r"nothing\.mcap"):
        wayfi.replay(tmp_path / "nothing.mcap", tmp_path / "out")
