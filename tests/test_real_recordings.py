"""Recordings of real robots: each replays with the defaults, leaves all files, and is as near to its reference as ever.

The WiFi of intel_wifi is simulated.
"""

import sys
from pathlib import Path

import pytest

from wayfi.recordings.mcap_log import open_recording
from wayfi.recordings.tum import read_tum
from wayfi.service.evaluate import evaluate

sys.path.insert(0, str(Path(__file__).parent))
from drives import RESULT_FILES, replay_by_cli

BOUND_M = {
    "b14test1": 2.5,
    "b24test2": 1.6,
    "b3test2": 1.6,
    "flat_calib3": 0.8,
    "intel": 0.25,
    "intel_wifi": 0.25,
}
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
    final = evaluate(tmp_path, truth).final.alignment.error
    assert final.not_covered == 0
    assert final.ate_rmse_m < BOUND_M[name]
