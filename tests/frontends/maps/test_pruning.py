"""A map that is driven again keeps its size, shows what has changed, and forgets what is gone."""

from dataclasses import replace

import numpy as np
import pytest
from building_maps.rounds import AROUND, CONFIG, round_map

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.lidar.visibility import VisibilityConfig
from wayfi.frontends.maps.building_map import BuildingMap, MapFingerprint
from wayfi.frontends.maps.pruning import PruningConfig, pruned
from wayfi.frontends.maps.seen_area import SeenArea
from wayfi.frontends.maps.selecting import alone
from wayfi.frontends.maps.staleness import StalenessConfig, without_stale_points
from wayfi.frontends.scan_points import ScanPoints
from wayfi.frontends.wifi.readings import mean_rssi

ORIGIN = Pose2()


def scan(points: list[tuple[float, float]]) -> ScanPoints:
    return ScanPoints(np.array(points), np.tile([0.0, 1.0], (len(points), 1)), ORIGIN)


def ring(radius_m: float, first: int = 0, count: int = 90) -> list[tuple[float, float]]:
    """Points all around, 4 degrees apart."""
    angles = np.radians(4.0) * np.arange(first, first + count)
    return [(radius_m * np.cos(a), radius_m * np.sin(a)) for a in angles]


def in_sessions(building: BuildingMap, first: int) -> BuildingMap:
    """The keyframes from `first` on are of another session."""
    return replace(building, keyframes=[replace(k, session=int(n >= first)) for n, k in enumerate(building.keyframes)])


def again(building: BuildingMap) -> BuildingMap:
    return pruned(building, PruningConfig(), VisibilityConfig(), CONFIG.grid)


def test_a_first_session_stays_whole() -> None:
    building = round_map(2)
    assert again(building) is building


def test_a_round_that_was_driven_again_adds_nothing() -> None:
    building = again(in_sessions(round_map(2), AROUND))
    assert len(building.keyframes) == AROUND
    assert {k.session for k in building.keyframes} == {0}
    assert all(f.b < AROUND for f in building.factors.values())
    assert building.poses == pytest.approx(round_map(1).poses, abs=1e-9)


def test_what_is_new_takes_the_place_of_the_nearest_keyframe() -> None:
    known = in_sessions(round_map(2), AROUND)
    changed = AROUND + 20
    shelf = scan([(float(x), y) for x in np.linspace(-2, 2, 60) for y in (2.5, -2.5)])
    keyframes = [replace(k, scan=shelf) if n == changed else k for n, k in enumerate(known.keyframes)]
    building = again(replace(known, keyframes=keyframes))
    new = [k for k in building.keyframes if k.session == 1]
    assert len(building.keyframes) == AROUND
    assert [k.stamp_ns for k in new] == [known.keyframes[changed].stamp_ns]


def test_a_new_wing_is_added() -> None:
    building = round_map(2)
    poses = building.poses.copy()
    poses[AROUND:, 0] += 60.0
    kept = again(replace(in_sessions(building, AROUND), poses=poses))
    assert len(kept.keyframes) > 1.3 * AROUND


def heard(keyframe: int, bssid: str) -> MapFingerprint:
    return MapFingerprint(keyframe, "phone", keyframe, Pose2(), 0.5 * keyframe, mean_rssi({bssid: [-50.0]}))


def test_new_fingerprints_take_the_place_of_those_of_the_same_place() -> None:
    old, new = "02:00:00:00:00:01", "02:00:00:00:00:02"
    prints = [heard(k, old) for k in range(0, AROUND, 2)] + [heard(AROUND + k, new) for k in range(0, 30, 2)]
    building = again(replace(in_sessions(round_map(2), AROUND), fingerprints=prints))
    bssids = [f.readings.bssids[0] for f in building.fingerprints]
    assert bssids.count(new) == 15
    assert 12 <= bssids.count(old) <= 15  # of the half that was not driven again, less what is within a metre of it
    places = building.fingerprint_poses()
    assert places[-1] == pytest.approx(round_map(1).poses[28], abs=1e-6)


def test_closures_of_keyframes_that_are_gone_go_and_a_veto_stays_with_its_closure() -> None:
    building = in_sessions(round_map(3), 2 * AROUND)
    vetoed = 2
    assert building.closures[vetoed].judged.keyframe_b < 2 * AROUND
    kept = again(replace(building, vetoed=frozenset({vetoed})))
    (number,) = kept.vetoed
    a, b = (building.closures[vetoed].judged.keyframe_a, building.closures[vetoed].judged.keyframe_b)
    assert (kept.closures[number].judged.keyframe_a, kept.closures[number].judged.keyframe_b) == (a, b)
    assert [c.judged.closure for c in kept.closures] == list(range(len(kept.closures)))
    assert all(n in kept.factors for c in kept.closures for n in c.factors)


def test_a_drive_that_was_not_found_is_a_map_of_its_own() -> None:
    building = in_sessions(round_map(2), AROUND)
    factors = {n: f for n, f in building.factors.items() if (f.a < AROUND) == (f.b < AROUND)}
    own = alone(replace(building, factors=factors), AROUND, CONFIG.grid)
    assert len(own.keyframes) == AROUND
    assert own.poses[0] == pytest.approx(np.zeros(3), abs=1e-9)
    assert own.poses == pytest.approx(round_map(1).poses, abs=1e-6)
    assert len(own.factors) == AROUND - 1


def test_points_that_later_scans_look_through_are_gone_and_all_others_stay() -> None:
    box = [(2.0, y) for y in np.linspace(-0.4, 0.4, 12)]
    known = round_map(1).keyframes[0]
    before = replace(known, scan=scan(ring(6.0) + box), hits=np.array(ring(6.0) + box, np.float32))
    later = [replace(known, scan=scan(ring(6.0)), path_m=float(n), session=1) for n in range(3)]
    poses = np.zeros((4, 3))
    cleaned = without_stale_points([before, *later], poses, 1, StalenessConfig(), VisibilityConfig())
    left = cleaned[0].scan
    assert left is not None
    assert sorted(map(tuple, left.points.tolist())) == sorted(ring(6.0))
    assert len(cleaned[0].hits) == len(ring(6.0))
    assert cleaned[1:] == later


def test_one_look_is_not_enough_and_what_is_hidden_stays() -> None:
    known = round_map(1).keyframes[0]
    box = [(2.0, y) for y in np.linspace(-0.4, 0.4, 12)]
    before = replace(known, scan=scan(ring(6.0) + box))
    once = [replace(known, scan=scan(ring(6.0)), path_m=0.0, session=1)]
    hidden = [replace(known, scan=scan(ring(1.0)), path_m=float(n), session=1) for n in range(3)]
    for later in (once, hidden):
        poses = np.zeros((1 + len(later), 3))
        kept = without_stale_points([before, *later], poses, 1, StalenessConfig(), VisibilityConfig())
        assert kept[0] is before


def test_what_lies_where_nothing_was_seen_is_novel() -> None:
    area = SeenArea(np.array([-10.0, -10.0]), np.array([10.0, 10.0]))
    area.add(scan(ring(4.0)), np.zeros(3))
    assert area.novel_share(scan(ring(4.1)), np.zeros(3)) == 0.0
    assert area.novel_share(scan(ring(5.0)), np.zeros(3)) == 1.0
    assert area.novel_share(scan(ring(4.0, count=45) + ring(6.0, first=45, count=45)), np.zeros(3)) == 0.5
    assert area.novel_share(scan(ring(30.0)), np.zeros(3)) == 1.0  # beyond its edges
    assert area.novel_share(None, np.zeros(3)) == 0.0
