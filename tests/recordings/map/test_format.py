"""FORMAT.md is enough to read a map: here with pyarrow and json alone, by its sentences."""

import hashlib
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from building_maps.made_up import made_up_map
from places import ROOT

from wayfi.backend.graph.factors import AxisFactor, NearFactor, WallFactor, WheelFactor
from wayfi.frontends.maps.building_map import BuildingMap
from wayfi.recordings.map.columns import read_parquet
from wayfi.recordings.map.factor_table import KINDS, factor_table, read_factors
from wayfi.recordings.map.saving import save_map

FORMAT = (ROOT / "recordings" / "map" / "FORMAT.md").read_text()


@pytest.fixture(scope="module")
def building() -> BuildingMap:
    return made_up_map(530)


@pytest.fixture(scope="module")
def folder(building: BuildingMap, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("saved") / "map"
    save_map(path, building)
    return path


def table(folder: Path, stem: str) -> dict[str, Any]:
    """The columns of a table, of all its parts in the order of their numbers."""
    names = sorted(
        name for name in json.loads((folder / "manifest.json").read_text())["files"] if name.startswith(stem)
    )
    parts = [pq.ParquetFile(folder / name).read().to_pydict() for name in names]
    return {column: [value for part in parts for value in part[column]] for column in parts[0]}


def test_the_manifest_names_every_file_with_its_checksum_and_its_own(folder: Path) -> None:
    manifest = json.loads((folder / "manifest.json").read_text())
    assert (manifest["format"], manifest["version"]) == ("wayfi-map", 2)
    assert set(manifest["files"]) | {"manifest.json"} == {path.name for path in folder.iterdir()}
    for name, file in manifest["files"].items():
        data = (folder / name).read_bytes()
        assert file == {"sha256": hashlib.sha256(data).hexdigest(), "size": len(data)}
    own = manifest.pop("sha256")
    assert own == hashlib.sha256(json.dumps(manifest, sort_keys=True).encode()).hexdigest()


def test_every_entry_file_and_column_is_in_the_text_and_nothing_else(folder: Path) -> None:
    manifest = json.loads((folder / "manifest.json").read_text())
    stems = {re.sub(r"\d{4}\.parquet", "NNNN.parquet", name) for name in manifest["files"]}
    stems = {re.sub(r"_floor\d+\.", "_floorN.", name) for name in stems}
    for name in {*manifest, *manifest["counts"].keys() - {"access_points"}, *stems}:
        assert re.search(rf"\b{re.escape(name)}\b", FORMAT), name
    columns = {column for path in folder.glob("*.parquet") for column in pq.ParquetFile(path).schema_arrow.names}
    between = {f"c{a}{b}" for a in "xyt" for b in "xyt"} - {"cxx", "ctt"}  # "`cxx` to `ctt`"
    assert {column for column in columns - between if f"`{column}`" not in FORMAT} == set()


def test_keyframes_and_scans_are_as_the_text_says(folder: Path, building: BuildingMap) -> None:
    keyframes, scans = table(folder, "keyframes"), table(folder, "scans")
    poses = np.column_stack([keyframes["x_m"], keyframes["y_m"], keyframes["theta_rad"]])
    np.testing.assert_array_equal(poses, building.poses)
    assert scans["keyframe"] == list(range(530))
    for k, kept in enumerate(building.keyframes):
        assert scans["matched"][k] == (kept.scan is not None)
        hits = np.column_stack([scans["hit_x_mm"][k], scans["hit_y_mm"][k]])
        np.testing.assert_allclose(hits.reshape(-1, 2) / 1000, kept.hits, atol=0.0006)
        if kept.scan:
            normals = np.array(scans["normal_0.1mrad"][k])
            known = normals != -32768
            angles = normals[known] / 10_000
            np.testing.assert_allclose(np.cos(angles), kept.scan.normals[known, 0], atol=0.0001)
            assert np.isnan(kept.scan.normals[~known]).all()


def test_factors_closures_and_fingerprints_are_as_the_text_says(folder: Path, building: BuildingMap) -> None:
    factors, heard, closures = table(folder, "factors"), table(folder, "fingerprints"), table(folder, "closures")
    assert factors["factor"] == list(building.factors)
    for row, factor in enumerate(building.factors.values()):
        assert (factors["a"][row], factors["b"][row]) == (factor.a, factor.b)
        match factor:
            case WheelFactor():
                assert factors["kind"][row] == "wheel"
                assert factors["cxy"][row] == factor.covariance[0, 1]
                assert factors["path_m"][row] == factor.motion.path_m
            case NearFactor():
                assert (factors["kind"][row], factors["place_b_y_m"][row]) == ("near", factor.place_b[1])
            case AxisFactor():
                assert (factors["kind"][row], factors["theta_rad"][row]) == ("axis", factor.turned)
    assert [tuple(bssids) for bssids in heard["bssids"]] == [f.readings.bssids for f in building.fingerprints]
    assert heard["rssi_dbm"] == [f.readings.rssi.tolist() for f in building.fingerprints]
    assert [k for k, vetoed in enumerate(closures["vetoed"]) if vetoed] == sorted(building.vetoed)
    weights = table(folder, "access_points")
    assert dict(zip(weights["bssid"], weights["weight"], strict=True)) == building.weights


def test_what_walls_told_of_a_heading_is_read_as_that() -> None:
    told = {4: AxisFactor(2, 1, 0.3, 0.1), 7: WallFactor(3, 2, -1.2, 0.02)}
    read = read_factors(read_parquet(factor_table(list(told), list(told.values()))))
    assert read == told
    assert {number: type(factor) for number, factor in read.items()} == {4: AxisFactor, 7: WallFactor}


def test_every_kind_of_factor_is_in_the_text() -> None:
    assert {kind for kind in KINDS.values() if f"| `{kind}` |" not in FORMAT} == set()


def test_the_grid_is_as_the_text_says(folder: Path, building: BuildingMap) -> None:
    for name, drawn in {"grid.parquet": building.grids[0], "grid_floor1.parquet": building.grids[1]}.items():
        grid = table(folder, name)
        rows = [np.frombuffer(row, np.int8) for row in grid["evidence"]]
        np.testing.assert_array_equal(rows, drawn.evidence)
        assert (grid["origin_x_m"][0], grid["origin_y_m"][0]) == drawn.origin_xy_m
