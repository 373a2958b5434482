"""The estimation saves the map as it goes, by command and at its end; it goes on as if it had not."""

import multiprocessing
import threading
from pathlib import Path

import pytest
from drives import Simulated, write

from wayfi.frontends.measurements import Sensor
from wayfi.recordings.map.loading import LoadedMap, load_map
from wayfi.recordings.mcap.recording import open_recording
from wayfi.recordings.ros.topics import Encoding
from wayfi.service.config import Config, load_config
from wayfi.service.daemon import estimator
from wayfi.service.daemon.estimator import Estimator
from wayfi.service.daemon.estimator_messages import Finish, Save, Saved, Start, Written
from wayfi.service.drive.control_records import ControlKind, ControlRecord
from wayfi.service.transport.message_queue import Received

Item = Received | ControlRecord | Save | Finish
END = Finish({}, {})


@pytest.fixture(scope="module")
def config() -> Config:
    return load_config((), ["rerun.enabled=false"])


@pytest.fixture(scope="module")
def messages(half_minute: Simulated, tmp_path_factory: pytest.TempPathFactory) -> list[Received]:
    recording = write(tmp_path_factory.mktemp("recording") / "recording.mcap", half_minute.arrivals)
    sensors = {"/odom": Sensor.ODOM, "/scan": Sensor.SCAN, "/wifi": Sensor.WIFI, "/tf_static": Sensor.TF_STATIC}
    records = open_recording(recording)
    return [Received(sensors[r.topic], r.topic, Encoding.CDR, r.data, 0.0) for r in records]


def estimate(
    folder: Path, config: Config, items: list[Item], after_each_save: list[LoadedMap] | None = None
) -> Written:
    """Feed an estimation; returns what it says at its end. `after_each_save` gets the maps that it saved by command."""
    theirs, feeding = multiprocessing.Pipe(duplex=False)
    reports, reporting = multiprocessing.Pipe(duplex=False)
    feeding.send(Start(config, None, folder, resumes=False))
    estimation = threading.Thread(target=lambda: Estimator(theirs, reporting).run())
    feeder = threading.Thread(target=lambda: [feeding.send(item) for item in items])
    estimation.start()
    feeder.start()
    while not isinstance(report := reports.recv(), Written):
        if isinstance(report, Saved) and after_each_save is not None:
            after_each_save.append(load_map(folder))
    estimation.join()
    feeder.join()
    return report


def checkpoint(number: int) -> ControlRecord:
    return ControlRecord(ControlKind.CHECKPOINT, number)


def test_the_map_grows_as_one_and_the_drive_is_as_if_none_was_saved(
    messages: list[Received], config: Config, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    third, saved = len(messages) // 3, []
    first, second, last = messages[:third], messages[third : 2 * third], messages[2 * third :]
    items = [*first, checkpoint(1), *second, checkpoint(2), Save(), *last, END]
    for name in ("saving", "plain"):
        (tmp_path / name).mkdir()
    assert not estimate(tmp_path / "saving", config, items, saved).error
    monkeypatch.setattr(Estimator, "_save_map", lambda _: None)
    assert not estimate(tmp_path / "plain", config, [item for item in items if not isinstance(item, Save)]).error
    end = load_map(tmp_path / "saving")
    assert [each.warnings for each in (*saved, end)] == [(), ()]
    assert [each.map_version for each in (*saved, end)] == [3, 4]
    assert saved[0].map_id == end.map_id
    assert 0 < len(saved[0].building.keyframes) < len(end.building.keyframes)
    for name in ("trajectory.tum", "online.tum", "map/keyframes.parquet", "map/scans_0000.parquet"):
        assert (tmp_path / "saving" / name).read_bytes() == (tmp_path / "plain" / name).read_bytes()


def test_the_map_is_saved_for_so_many_new_keyframes_and_no_more_for_a_robot_that_stands(
    messages: list[Received], config: Config, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(estimator, "MAP_KEYFRAMES", 5)
    assert not estimate(tmp_path, config, [*messages, checkpoint(1), checkpoint(2), END]).error
    end = load_map(tmp_path)
    full, over = divmod(len(end.building.keyframes), 5)
    assert full > 2
    assert end.map_version == full + (over > 0) + 1


def test_a_drive_without_a_keyframe_has_no_map_on_the_way(config: Config, tmp_path: Path) -> None:
    assert not estimate(tmp_path, config, [checkpoint(1), END]).error
    assert load_map(tmp_path).building.keyframes == []


def test_a_map_that_cannot_be_saved_on_the_way_stops_nothing(
    messages: list[Received], config: Config, tmp_path: Path
) -> None:
    (tmp_path / "map").write_text("in the way")
    written = estimate(tmp_path, config, [*messages[:400], checkpoint(1), *messages[400:500], END])
    assert "map: cannot be written" in written.error
