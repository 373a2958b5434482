"""What a saved map holds, in numbers and in words."""

from pathlib import Path

import pytest
from building_maps.made_up import made_up_map
from command_line import one_object, wayfi

from wayfi.recordings.map.saving import save_map
from wayfi.service.maps.describing import describe, is_map, words_of


@pytest.fixture
def results(tmp_path: Path) -> Path:
    save_map(tmp_path / "map", made_up_map(30))
    return tmp_path


def test_a_map_is_told_from_a_recording(results: Path) -> None:
    assert is_map(results)
    assert is_map(results / "map")
    assert not is_map(results / "nowhere")
    assert not is_map(results / "map" / "manifest.json")
    (results / "recording.mcap").touch()
    assert not is_map(results)
    assert is_map(results / "map")


def test_a_map_is_described_in_numbers(results: Path) -> None:
    building, found = made_up_map(30), describe(results)
    assert (found.keyframes, found.scans, found.sessions, found.floors) == (30, 26, 2, (0, 1))
    assert (found.fingerprints, found.access_points) == (10, len(building.weights))
    assert (found.closures, found.vetoed) == (1, 1)
    assert found.path_m == pytest.approx(14.0)  # 0.5 m each, but for the step between the sessions
    assert found.size_bytes == sum(path.stat().st_size for path in (results / "map").iterdir())
    assert found.whole


def test_a_map_is_described_in_words_and_its_damage_too(results: Path) -> None:
    assert "10 fingerprints of" in " ".join(words_of(describe(results)))
    (results / "map" / "scans_0000.parquet").unlink()
    told = wayfi("inspect", results)
    assert told.exit_code == 0
    assert "seen on floors 0, 1; 14 m driven in 2 sessions" in told.stdout
    assert "30 keyframes, 0 with a scan" in told.stdout
    assert "damaged:" in told.stdout
    assert "scans_0000.parquet: is missing: keyframes 0 to 255 have no scan" in told.stdout.replace("\n", " ")


def test_programs_get_the_same_as_json(results: Path) -> None:
    found = one_object(wayfi("inspect", results / "map", "--json"))
    assert (found["keyframes"], found["whole"], found["warnings"]) == (30, True, [])


def test_a_map_that_cannot_be_loaded_is_said_in_one_line(results: Path) -> None:
    (results / "map" / "keyframes.parquet").unlink()
    told = wayfi("inspect", results)
    assert told.exit_code == 1
    assert "without it there is no map" in told.stderr
    assert len(told.stderr.splitlines()) == 1
