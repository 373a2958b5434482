"""What is saved of a map is loaded again: to the bit, and scans to their quantum."""

from pathlib import Path

import numpy as np
import pytest
from building_maps.made_up import grown, made_up_map

import wayfi
from wayfi.frontends.maps.building_map import BuildingMap
from wayfi.recordings.map.loading import load_map
from wayfi.recordings.map.manifest import MapName
from wayfi.recordings.map.saving import MapSaver, save_map

HALF_MM, HALF_QUANTUM_RAD = 0.000_501, 0.000_051


def plain(value: object) -> object:
    """Frozen values as lists, to be compared to the bit."""
    if isinstance(value, np.ndarray):
        return value.dtype.name, value.tobytes()
    if hasattr(value, "__dataclass_fields__"):
        return type(value).__name__, [plain(getattr(value, name)) for name in value.__dataclass_fields__]
    if isinstance(value, float):
        return np.float64(value).tobytes()
    return [plain(each) for each in value] if isinstance(value, tuple | list) else value


def assert_scans_are_the_same(saved: BuildingMap, loaded: BuildingMap) -> None:
    for one, other in zip(saved.keyframes, loaded.keyframes, strict=True):
        np.testing.assert_allclose(other.hits, one.hits, atol=HALF_MM)
        assert (one.scan is None) == (other.scan is None)
        if one.scan and other.scan:
            np.testing.assert_allclose(other.scan.points, one.scan.points, atol=HALF_MM)
            np.testing.assert_allclose(other.scan.normals, one.scan.normals, atol=HALF_QUANTUM_RAD)
            assert plain(other.scan.T_base_laser) == plain(one.scan.T_base_laser)


def assert_same(saved: BuildingMap, loaded: BuildingMap) -> None:
    assert_scans_are_the_same(saved, loaded)
    keyframes = [[(k.stamp_ns, k.path_m, k.session, k.floor) for k in each.keyframes] for each in (saved, loaded)]
    assert keyframes[0] == keyframes[1]
    for name in ("poses", "calibrations", "closures", "fingerprints", "pieces", "grid"):
        assert plain(getattr(saved, name)) == plain(getattr(loaded, name)), name
    assert factors(saved) == factors(loaded)
    assert (saved.weights, saved.vetoed) == (loaded.weights, loaded.vetoed)
    assert plain(saved.calibration.wheels) == plain(loaded.calibration.wheels)
    assert saved.calibration.receivers == loaded.calibration.receivers


def factors(building: BuildingMap) -> dict[int, object]:
    return {number: plain(factor) for number, factor in building.factors.items()}


@pytest.mark.parametrize("keyframes", [0, 1, 30, 700])
def test_a_map_is_loaded_as_it_was_saved(keyframes: int, tmp_path: Path) -> None:
    building = made_up_map(keyframes)
    name = save_map(tmp_path / "map", building)
    loaded = load_map(tmp_path / "map")
    assert_same(building, loaded.building)
    assert (loaded.name, loaded.warnings) == (name, ())


def test_a_loaded_map_that_is_saved_again_is_the_same_to_the_byte(tmp_path: Path) -> None:
    name = save_map(tmp_path / "one", made_up_map(300))
    save_map(tmp_path / "two", load_map(tmp_path / "one").building)
    assert contents(tmp_path / "one") == contents(tmp_path / "two")
    assert load_map(tmp_path / "two").name == name


def test_a_map_saved_as_it_grew_is_that_saved_at_its_end(tmp_path: Path) -> None:
    building = made_up_map(700)
    saver = MapSaver(tmp_path / "grown")
    for keyframes in (1, 100, 256, 600, 700, 100, 700):
        name = saver.save(grown(building, keyframes))
    save_map(tmp_path / "whole", grown(building, 700), former=MapName(name.map_id, name.map_version - 1))
    assert contents(tmp_path / "grown") == contents(tmp_path / "whole")
    assert name.map_version == 7


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_results_are_as_good_a_path_as_the_map_in_them(tmp_path: Path) -> None:
    name = save_map(tmp_path / "map", made_up_map(3))
    assert load_map(tmp_path).name == wayfi.load_map(str(tmp_path)).name == name
