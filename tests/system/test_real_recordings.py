"""Recordings of real robots: each replays with the defaults, leaves all files, and is as near to its reference as ever.

The WiFi of intel_wifi is simulated.
"""

import math
from pathlib import Path

import pytest
from drives import RESULT_FILES, replay_by_cli

from wayfi.frontends.events import ClosureKind
from wayfi.recordings.files.tum import read_tum
from wayfi.recordings.mcap.recording import open_recording
from wayfi.service.evaluation.evaluate import evaluate

BOUND_M = {
    "b14test1": 0.29,
    "b24test2": 0.25,
    "b3test2": 1.0,
    "flat_calib3": 0.8,
    "intel": 0.25,
    "intel_wifi": 0.25,
}
ONLINE_BOUND_M = {"b14test1": 3.4, "b24test2": 7.0, "b3test2": 2.6}  # nothing but the axes of the building helps
LED_BY_LASER = {"flat_calib3": 46}  # scans of the seconds before the first odometry and after the last


@pytest.mark.parametrize("name", BOUND_M)
def test_a_real_recording_is_near_its_reference(name: str, real_data: Path, tmp_path: Path) -> None:
    recording, truth = real_data / name / "recording.mcap", real_data / name / "truth.tum"
    report = replay_by_cli(recording, tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == {*RESULT_FILES, "map"}
    assert report["messages"] == dict(open_recording(recording).message_counts)
    by_laser = LED_BY_LASER.get(name, 0)
    accepted = report["messages"]["/odom"] - sum(report["dropped"].get("/odom", {}).values())
    assert len(read_tum(tmp_path / "trajectory.tum")) == accepted + by_laser
    assert ("no odometry: the laser leads" in report["warnings"]) == (by_laser > 0)
    evaluation = evaluate(tmp_path, truth)
    final = evaluation.final.alignment.error
    assert final.not_covered == 0
    assert final.ate_rmse_m < BOUND_M[name]
    assert evaluation.online.alignment.error.ate_rmse_m < ONLINE_BOUND_M.get(name, math.inf)


@pytest.fixture(scope="module")
def learnt(real_data: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What a drive in one building leaves, without a calibration from before."""
    out = tmp_path_factory.mktemp("learnt")
    replay_by_cli(real_data / "b14test1" / "recording.mcap", out, "--no-rrd")
    return out


def test_wheels_and_wifi_are_located_as_they_drive_once_a_loop_is_closed(learnt: Path, real_data: Path) -> None:
    evaluation = evaluate(learnt, real_data / "b14test1" / "truth.tum")
    assert evaluation.online.alignment.error.ate_rmse_m < ONLINE_BOUND_M["b14test1"]
    wifi = evaluation.closures[ClosureKind.WIFI]
    assert wifi.accepted >= 10
    assert wifi.precision is not None
    assert wifi.precision >= 0.95


@pytest.mark.parametrize("name", ["b24test2", "b3test2"])
def test_what_one_building_taught_of_the_wheels_holds_in_the_next(
    name: str, learnt: Path, real_data: Path, tmp_path: Path
) -> None:
    recording, truth = real_data / name / "recording.mcap", real_data / name / "truth.tum"
    replay_by_cli(recording, tmp_path, "--no-rrd", "--calibration", learnt / "calibration.toml")
    evaluation = evaluate(tmp_path, truth)
    assert evaluation.final.alignment.error.ate_rmse_m < BOUND_M[name]
    assert evaluation.online.alignment.error.ate_rmse_m < 2.5
    wifi = evaluation.closures[ClosureKind.WIFI]
    assert wifi.right == wifi.scored > 0
