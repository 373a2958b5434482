"""When the map is searched: how much in one message, where WiFi says, and what fits apart from where it should."""

import numpy as np
import pytest
from building_maps.halls import around, hall, map_of
from rooms import see

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.localization.hypotheses import Hypothesis
from wayfi.frontends.localization.local_track import LocalTrack
from wayfi.frontends.localization.localization_config import ClaimConfig, LocalizationConfig
from wayfi.frontends.localization.localizer import Localizer
from wayfi.frontends.localization.map_matching import Agreement, Fix
from wayfi.frontends.localization.proposals import Proposals
from wayfi.frontends.localization.wifi.clusters import PlaceBelief
from wayfi.frontends.localization.wifi.particles import Cloud
from wayfi.frontends.localization.wifi_support import WifiSupport
from wayfi.frontends.maps.building_map import BuildingMap
from wayfi.frontends.measurements import SECOND_NS
from wayfi.frontends.odometry.driven_path import PathPoint
from wayfi.frontends.scan_points import PlacedScan
from wayfi.frontends.slam_config import SlamConfig

UNKNOWN = WifiSupport(())


@pytest.fixture(scope="module")
def building() -> BuildingMap:
    return map_of(hall(), around(0.0, 96.0))


@pytest.fixture
def track(building: BuildingMap) -> LocalTrack:
    track = LocalTrack(SlamConfig().lidar, SlamConfig().odometry, building.calibration.wheels.values)
    scan = see(hall().walls, Pose2.of(around(0.0, 96.0)[5]), np.random.default_rng(1))
    track.add(PathPoint(0, Pose2(), 0.0), PlacedScan(scan, scan.points.astype(np.float32)))
    return track


def named(weight: float) -> WifiSupport:
    at = Pose2(5.0, 0.0, 0.0)
    cloud = Cloud(at.array()[None], np.zeros(1, np.int64), np.array([weight]))
    return WifiSupport([PlaceBelief(at, np.diag([1.0, 1.0, 0.1]), weight)], cloud)


def test_a_search_of_the_whole_map_ends_once_wifi_names_a_part_of_it(building: BuildingMap, track: LocalTrack) -> None:
    proposals = Proposals(building, track, SlamConfig().lidar, LocalizationConfig())
    assert proposals.begin(UNKNOWN)
    proposals.narrow(UNKNOWN)
    proposals.narrow(named(0.1))
    assert proposals.running
    proposals.narrow(named(0.9))
    assert not proposals.running
    assert proposals.begin(named(0.9))
    proposals.narrow(named(0.9))
    assert proposals.running


@pytest.mark.parametrize(("step", "due"), [(Pose2(1.1), True), (Pose2(0.5), False), (Pose2(0.5, 0.0, -0.6), True)])
def test_the_map_is_searched_again_once_the_robot_has_driven_or_turned(
    building: BuildingMap, track: LocalTrack, step: Pose2, due: bool
) -> None:
    proposals = Proposals(building, track, SlamConfig().lidar, LocalizationConfig())
    assert proposals.begin(named(0.9))
    while proposals.running:
        proposals.go_on()
    assert not proposals.begin(named(0.9))
    scan = see(hall().walls, Pose2.of(around(0.0, 96.0)[5]) @ step, np.random.default_rng(2))
    track.add(PathPoint(SECOND_NS, step, step.x), PlacedScan(scan, scan.points.astype(np.float32)))
    assert proposals.begin(named(0.9)) == due


@pytest.mark.parametrize("silent", [False, True])
def test_a_hypothesis_tells_whether_every_scan_on_its_way_agreed(silent: bool) -> None:
    hypothesis, config = Hypothesis(Pose2(), 1e-3 * np.eye(3), 0), ClaimConfig()
    for k, agreement in enumerate(
        [Agreement.AGREES, Agreement.SILENT if silent else Agreement.AGREES, Agreement.AGREES]
    ):
        hypothesis.T_map_base = Pose2(0.5 * k)
        hypothesis.update(Fix(hypothesis.T_map_base, 1e-3 * np.eye(3), 0.9, 0.0, 0.9, agreement), 0.5 * k, config)
    assert hypothesis.all_agreed != silent
    assert hypothesis.agreed == 3 - silent


@pytest.mark.parametrize(("apart_s", "slices"), [(0.1, 1), (0.05, 0), (3.0, 2)])
def test_a_message_does_more_work_the_longer_none_came(
    building: BuildingMap, track: LocalTrack, monkeypatch: pytest.MonkeyPatch, apart_s: float, slices: int
) -> None:
    localizer = Localizer(building, track, SlamConfig().lidar, LocalizationConfig(most_due=3))
    done: list[int] = []
    localizer.go_on(SECOND_NS)
    localizer._due = 0.0
    monkeypatch.setattr(Localizer, "_work", lambda _: done.append(1))
    localizer.go_on(SECOND_NS + round(apart_s * SECOND_NS))
    assert len(done) == slices


def test_a_clock_that_steps_back_owes_no_work(building: BuildingMap, track: LocalTrack) -> None:
    localizer = Localizer(building, track, SlamConfig().lidar, LocalizationConfig())
    localizer.go_on(100 * SECOND_NS)
    localizer.go_on(0)
    assert localizer._due >= 0.0


def test_a_scan_that_fits_apart_widens_the_pose_and_is_no_agreement() -> None:
    hypothesis = Hypothesis(Pose2(), np.diag([1e-3, 1e-3, 4e-4]), 0)
    fix = Fix(Pose2(0.1, 0.1, 0.1), 1e-4 * np.eye(3), 0.98, 0.0, 0.9, Agreement.APART)
    hypothesis.update(fix, 1.0, ClaimConfig())
    assert hypothesis.T_map_base == Pose2()
    assert hypothesis.covariance[2, 2] == pytest.approx(16e-4)
    assert (hypothesis.agreed, hypothesis.unsure, hypothesis.contradicted) == (0, 1, 0)
