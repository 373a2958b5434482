"""`wayfi replay --map`, by files: the map gets its next version, and a drive that is not found there one of its own."""

import json
from pathlib import Path

from buildings.localizing import Mapped
from buildings.robots import drive
from buildings.storey import another_building, storey
from command_line import wayfi
from drives import write

from wayfi.recordings.map.loading import load_map

WAY = ((18.0, 12.5), (24.0, 12.5), (24.0, 7.5), (9.0, 7.5))
ELSEWHERE = ((14.0, 3.0), (19.0, 3.0), (19.0, 8.0), (8.0, 8.0))


def test_the_map_gets_its_next_version(mapped: Mapped, tmp_path: Path) -> None:
    recording = write(tmp_path / "day1.mcap", drive(storey(), WAY, day=1).arrivals)
    done = wayfi("replay", recording, "--map", mapped.out, "--out", tmp_path / "out", "--no-rrd", "--json")
    assert done.exit_code == 0, done.output
    before, after = load_map(mapped.out), load_map(tmp_path / "out")
    assert (after.map_id, after.map_version) == (before.map_id, before.map_version + 1)
    assert len(after.building.keyframes) < 1.3 * len(before.building.keyframes)
    states = [change["state"] for change in json.loads(done.stdout)["status_changes"]]
    assert states[0] == "RELOCALISING"
    assert "TRACKING" in states
    whole, published = ((tmp_path / "out" / name).read_text().splitlines() for name in ("trajectory.tum", "online.tum"))
    assert 0 < len(published) < len(whole)


def test_a_drive_that_is_not_found_there_is_another_map(mapped: Mapped, tmp_path: Path) -> None:
    recording = write(tmp_path / "other.mcap", drive(another_building(), ELSEWHERE, day=1).arrivals)
    done = wayfi("replay", recording, "--map", mapped.out, "--out", tmp_path / "out", "--no-rrd", "--json")
    assert done.exit_code == 0, done.output
    known, other = load_map(mapped.out), load_map(tmp_path / "out")
    assert other.map_id != known.map_id
    assert other.map_version == 1
    assert any("not found in the map" in text for text in json.loads(done.stdout)["warnings"])


def test_a_map_that_is_not_there_is_refused_in_one_line(tmp_path: Path) -> None:
    recording = write(tmp_path / "day1.mcap", drive(storey(), WAY[:2], day=1).arrivals)
    done = wayfi("replay", recording, "--map", tmp_path / "nowhere", "--out", tmp_path / "out")
    assert done.exit_code == 1
    assert done.stderr.count("\n") == 1
    assert "nowhere" in done.stderr
