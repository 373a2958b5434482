"""A damaged map says what is damaged, and is loaded as far as it is whole."""

import json
import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from building_maps.made_up import made_up_map

from wayfi.backend.graph.backend_config import BackendConfig
from wayfi.backend.grid.map_config import MapConfig
from wayfi.frontends.maps.building_map import BuildingMap
from wayfi.frontends.maps.optimising import OptimisingConfig, optimise
from wayfi.frontends.odometry.odometry_config import OdometryConfig, calibration_prior
from wayfi.recordings.files.map_folder import MANIFEST, MapError
from wayfi.recordings.map.loading import load_map
from wayfi.recordings.map.manifest import manifest_text, read_manifest
from wayfi.recordings.map.saving import save_map

KEYFRAMES = 530
FOLLOWS = {
    "scans_0001.parquet": "keyframes 256 to 511 have no scan",
    "factors_0000.parquet": "factors 0 to 2047 are lost: the steps among them are made of the poses",
    "closures_0000.parquet": "closures 0 to 511 are lost, with their vetoes",
    "fingerprints_0000.parquet": "fingerprints 0 to 511 are lost: WiFi does not know their places",
    "access_points.parquet": "every access point counts the same",
    "calibration.toml": "the wheels are as at the newest keyframe",
    "grid.parquet": "the grid is drawn again from the scans",
    "graph.g2o": "other programs cannot open it",
    "map.pgm": "other programs cannot open it",
    "map.yaml": "other programs cannot open it",
}


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("saved") / "map"
    save_map(path, made_up_map(KEYFRAMES, beams=8))
    return path


@pytest.fixture
def folder(whole: Path, tmp_path: Path) -> Path:
    return shutil.copytree(whole, tmp_path / "map")


def flip(path: Path) -> None:
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)


def cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


DAMAGES = {"was changed since it was written": flip, r"has \d+ bytes of \d+": cut, "is missing": Path.unlink}


@pytest.mark.parametrize("how", DAMAGES)
@pytest.mark.parametrize("name", FOLLOWS)
def test_a_damaged_file_is_named_with_what_follows_and_the_rest_is_loaded(name: str, how: str, folder: Path) -> None:
    DAMAGES[how](folder / name)
    loaded = load_map(folder)
    assert len(loaded.warnings) == 1
    assert re.match(f"{re.escape(str(folder / name))}: {how}: {FOLLOWS[name]}", loaded.warnings[0])
    assert_rest_is_whole(name, loaded.building)


def assert_rest_is_whole(name: str, building: BuildingMap) -> None:
    saved = made_up_map(KEYFRAMES, beams=8)
    np.testing.assert_array_equal(building.poses, saved.poses)
    scans = [k for k, keyframe in enumerate(saved.keyframes) if keyframe.scan]
    kept = [k for k in scans if name != "scans_0001.parquet" or not 256 <= k < 512]
    assert [k for k, keyframe in enumerate(building.keyframes) if keyframe.scan] == kept
    assert len(building.fingerprints) == (0 if "fingerprints" in name else len(saved.fingerprints))
    assert len(building.closures) == (0 if "closures" in name else len(saved.closures))
    assert set(range(1, KEYFRAMES)) <= {f.b for f in building.factors.values() if f.b - f.a == 1}
    assert building.weights == ({} if "access_points" in name else saved.weights)
    assert building.grid.evidence.shape == saved.grid.evidence.shape


@pytest.mark.parametrize("how", DAMAGES)
def test_without_its_keyframes_there_is_no_map(how: str, folder: Path) -> None:
    DAMAGES[how](folder / "keyframes.parquet")
    with pytest.raises(MapError, match=rf"keyframes\.parquet: {how}: without it there is no map"):
        load_map(folder)


@pytest.mark.parametrize("byte", [5, 60, 300, -60])
def test_a_flipped_byte_of_the_manifest_is_found(byte: int, folder: Path) -> None:
    data = bytearray((folder / MANIFEST).read_bytes())
    data[byte] ^= 1
    (folder / MANIFEST).write_bytes(data)
    with pytest.raises(MapError, match=r"manifest\.json: is "):
        load_map(folder)


def test_lost_factors_leave_a_graph_that_keeps_the_poses(tmp_path: Path) -> None:
    folder = tmp_path / "map"
    save_map(folder, made_up_map(100, beams=8))
    (folder / "factors_0000.parquet").unlink()
    loaded = load_map(folder).building
    config = OptimisingConfig(BackendConfig(), MapConfig(), calibration_prior(OdometryConfig()))
    np.testing.assert_allclose(optimise(loaded, config).poses, loaded.poses, atol=1e-6)


def test_what_a_damaged_map_is_saved_as_is_whole(folder: Path) -> None:
    for name in FOLLOWS:
        flip(folder / name)
    damaged = load_map(folder)
    assert len(damaged.warnings) == len(FOLLOWS)
    save_map(folder, damaged.building, former=damaged.name)
    again = load_map(folder)
    assert (again.warnings, again.map_version) == ((), damaged.map_version + 1)


def test_a_folder_without_a_map_is_said(tmp_path: Path) -> None:
    with pytest.raises(MapError, match=r"holds no map: there is no manifest\.json"):
        load_map(tmp_path)
    with pytest.raises(MapError, match="holds no map"):
        load_map(tmp_path / "nowhere")


@pytest.mark.parametrize("text", ["", "[]", "{}", "nonsense", '{"format": "wayfi-map"}', "\xff"])
def test_a_manifest_that_is_none_is_said(text: str, folder: Path) -> None:
    (folder / MANIFEST).write_text(text, encoding="latin-1")
    with pytest.raises(MapError, match=r"manifest\.json: is "):
        load_map(folder)


def versioned(folder: Path, version: int) -> None:
    manifest = json.loads((folder / MANIFEST).read_text())
    (folder / MANIFEST).write_text(json.dumps(manifest | {"version": version}))


def test_a_map_of_a_newer_wayfi_is_refused(folder: Path) -> None:
    versioned(folder, 3)
    with pytest.raises(MapError, match="is of version 3, this wayfi loads up to version 2: install a newer one"):
        load_map(folder)


def test_a_folder_of_version_1_is_no_map(tmp_path: Path) -> None:
    (tmp_path / MANIFEST).write_text('{"format": "wayfi-map", "version": 1}\n')
    (tmp_path / "graph.g2o").write_text("VERTEX_SE2 0 0 0 0\n")
    with pytest.raises(MapError, match="of version 1 holds the graph alone, which is no map to load: replay"):
        load_map(tmp_path)


def test_a_table_with_a_right_checksum_and_wrong_columns_is_said(folder: Path) -> None:
    shutil.copy(folder / "access_points.parquet", folder / "grid.parquet")
    manifest = read_manifest(folder)
    files = {**manifest.files, "grid.parquet": manifest.files["access_points.parquet"]}
    (folder / MANIFEST).write_text(manifest_text(replace(manifest, files=files)))
    assert "grid.parquet: does not hold what it should" in load_map(folder).warnings[0]
