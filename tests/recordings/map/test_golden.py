"""A map that a former wayfi has saved is loaded as it was: one is kept of every version of the format.

They are never written again. Each holds 24 keyframes of two sessions on two floors, every seventh without a scan.
"""

from pathlib import Path

import numpy as np
import pytest

from wayfi.backend.graph.factors import AxisFactor, BetweenFactor, NearFactor, WheelFactor
from wayfi.recordings.map.loading import LoadedMap, load_map

GOLDEN = Path(__file__).with_name("golden")


@pytest.fixture(params=sorted(GOLDEN.iterdir()), ids=lambda folder: folder.name)
def loaded(request: pytest.FixtureRequest) -> LoadedMap:
    return load_map(request.param)


def test_all_of_a_golden_map_is_loaded(loaded: LoadedMap) -> None:
    assert loaded.warnings == ()
    assert (loaded.map_id, loaded.map_version) == ("5cf709263e8db4a433c19af7c7a5ffbf", 1)
    building = loaded.building
    assert [len(rows) for rows in (building.keyframes, building.factors, building.closures)] == [24, 50, 2]
    assert [len(rows) for rows in (building.fingerprints, building.weights)] == [8, 22]
    assert (building.vetoed, building.pieces) == (frozenset({1}), (5,))


def test_keyframes_and_scans_of_a_golden_map_are_as_they_were(loaded: LoadedMap) -> None:
    building = loaded.building
    assert building.poses[5].tolist() == [2.5, 0.5035208649940508, 2.0981600558786804]
    assert [k for k, keyframe in enumerate(building.keyframes) if keyframe.scan is None] == [3, 10, 17]
    assert [k for k, keyframe in enumerate(building.keyframes) if keyframe.floor == 1] == list(range(16, 24))
    first = building.keyframes[0]
    assert first.scan is not None
    assert first.stamp_ns == 1_700_000_000_123_456_789
    np.testing.assert_allclose(first.hits[0], [-0.162, -1.03], atol=1e-6)
    np.testing.assert_allclose(first.scan.points[0], [-0.161, -1.029])
    np.testing.assert_allclose(first.scan.normals[:2], [[np.nan, np.nan], [0.31000313, -0.95073554]], atol=1e-8)
    assert building.grid.evidence.tolist() == [[0, 3, -2], [1, 0, -1]]
    assert building.grid.origin_xy_m == (-1.0, 2.5)


def test_the_graph_and_the_radio_of_a_golden_map_are_as_they_were(loaded: LoadedMap) -> None:
    building = loaded.building
    kinds = [type(factor) for factor in building.factors.values()]
    assert [kinds.count(kind) for kind in (WheelFactor, BetweenFactor, NearFactor, AxisFactor)] == [23, 23, 2, 2]
    wheel = building.factors[9]
    assert isinstance(wheel, WheelFactor)
    assert (wheel.a, wheel.b, wheel.motion.seconds, wheel.motion.discontinuities) == (2, 3, 0.5948131365802575, 1)
    heard = building.fingerprints[2]
    assert (heard.readings.bssids[0], heard.readings.rssi[0]) == ("02:00:00:00:00:01", np.float32(-54.406296))
    assert building.weights["02:00:00:00:00:1f"] == 0.017016047011542135
