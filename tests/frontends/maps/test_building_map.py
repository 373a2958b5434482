"""A map in memory: where its fingerprints are."""

from dataclasses import replace

import numpy as np
import pytest
from building_maps.rounds import round_map

from wayfi.backend.pose2 import Pose2, compose_all
from wayfi.frontends.maps.building_map import MapFingerprint
from wayfi.frontends.wifi.readings import mean_rssi


def test_fingerprints_follow_their_keyframes() -> None:
    place = Pose2(0.3, -0.1, 0.2)
    heard = [MapFingerprint(k, "phone", k, place, 0.5 * k, mean_rssi({"02:00:00:00:00:01": [-50.0]})) for k in (3, 40)]
    building = replace(round_map(1), fingerprints=heard)
    moved = Pose2(5.0, -3.0, 1.0)
    turned = replace(building, poses=compose_all(moved.array(), building.poses))
    expected = moved.transform(building.fingerprint_poses()[:, :2])
    assert turned.fingerprint_poses()[:, :2] == pytest.approx(expected, abs=1e-9)
    assert round_map(1).fingerprint_poses().shape == (0, 3)
    assert np.hypot(*(building.fingerprint_poses()[:, :2] - building.poses[[3, 40], :2]).T) == pytest.approx(0.1**0.5)
