"""A drive that goes on with the map of an earlier day: it is found there, and the map stays one."""

from dataclasses import replace
from functools import cache
from itertools import islice

import numpy as np
import pytest
from buildings.robots import drive
from buildings.storey import ROUTE, another_building, storey
from drives import Simulated

from wayfi.backend.graph.health import State
from wayfi.backend.graph.pose_graph import REBUILD_WORK, PoseGraph, UpdateSummary
from wayfi.backend.pose2 import Floats, Pose2, rigid_fit
from wayfi.frontends.calibration import Calibration
from wayfi.frontends.events import ClosureJudged, Event, PosePublished, StateChanged, Verdict, Warned
from wayfi.frontends.keyframes import Keyframe
from wayfi.frontends.maps.building_map import BuildingMap
from wayfi.frontends.measurements import SECOND_NS, StaticTransforms
from wayfi.frontends.modes.continued_slam import ContinuedSlam
from wayfi.frontends.odometry.driven_path import PathPoint
from wayfi.frontends.odometry.odometry_config import calibration_prior
from wayfi.frontends.pipeline import Pipeline
from wayfi.frontends.result import DriveEstimate
from wayfi.frontends.scan_points import PlacedScan, ScanPoints
from wayfi.frontends.slam import SlamCore
from wayfi.frontends.slam_config import SlamConfig
from wayfi.frontends.timer import untimed

CONFIG = SlamConfig()


@cache
def first_day() -> tuple[BuildingMap, Simulated]:
    """The map of the first day, and the drive that made it."""
    simulated = drive(storey(1), ROUTE, day=0)
    return estimated(simulated)[0].building, simulated


def estimated(simulated: Simulated, building: BuildingMap | None = None) -> tuple[DriveEstimate, list[Event]]:
    """The drive, going on with a map if there is one; what is published and told."""
    pipeline = Pipeline(CONFIG, building=building, extends=True)
    events = [event for a in simulated.arrivals for event in pipeline.process(a.measurement)]
    result, last = pipeline.finish()
    return result, events + last


def off_m(result: DriveEstimate, simulated: Simulated, building: BuildingMap, truth: Simulated) -> Floats:
    """(n,) how far the final trajectory is from the truth, where the map puts that."""
    stamps = np.array([k.stamp_ns for k in building.keyframes])
    T = rigid_fit(building.poses[:, :2], truth.truth.at(stamps)[:, :2])
    return np.hypot(*(T.transform(result.final[:, :2]) - simulated.truth.at(result.stamps_ns)[:, :2]).T)


def test_another_day_is_estimated_in_the_frame_of_the_map_and_keeps_its_size() -> None:
    building, truth = first_day()
    again = drive(storey(1), ROUTE[::-1], day=1)
    result, events = estimated(again, building)
    off = off_m(result, again, building, truth)
    assert np.sqrt((off**2).mean()) < 0.05
    published = [e for e in events if isinstance(e, PosePublished)]
    assert 0 < len(published) < len(result.stamps_ns)  # none before the robot was found
    assert len(result.building.keyframes) < 1.3 * len(building.keyframes)
    assert len(result.building.fingerprints) < 1.3 * len(building.fingerprints)
    known = {k.stamp_ns: pose for k, pose in zip(building.keyframes, building.poses, strict=True)}
    kept = list(zip(result.building.keyframes, result.building.poses, strict=True))
    moved_m = [np.hypot(*(pose - known[k.stamp_ns])[:2]) for k, pose in kept if k.stamp_ns in known]
    assert len(moved_m) > 0.7 * len(kept)
    assert max(moved_m) < 0.1


def test_joining_is_sliced_and_the_pose_that_was_found_is_claimed_meanwhile(monkeypatch: pytest.MonkeyPatch) -> None:
    building, truth = first_day()
    again = drive(storey(1), ROUTE[::-1], day=1)
    pipeline, works, update = Pipeline(CONFIG, building=building, extends=True), [], PoseGraph.update

    def counted(graph: PoseGraph, work: float = REBUILD_WORK) -> UpdateSummary:
        works.append((work, graph.restarts))
        return update(graph, work)

    monkeypatch.setattr(PoseGraph, "update", counted)
    stream = (event for a in again.arrivals for event in pipeline.process(a.measurement))
    published = list(islice((e for e in stream if isinstance(e, PosePublished)), 50))
    assert sum(restarts for _, restarts in works) >= 3  # messages of joining
    assert max(work for work, _ in works) <= REBUILD_WORK
    assert {e.state for e in published} == {State.TRACKING}
    stamps = np.array([k.stamp_ns for k in building.keyframes])
    T = rigid_fit(building.poses[:, :2], truth.truth.at(stamps)[:, :2])
    xy = T.transform(np.array([[e.T_map_base.x, e.T_map_base.y] for e in published]))
    off = np.hypot(*(xy - again.truth.at(np.array([e.stamp_ns for e in published]))[:, :2]).T)
    assert off.max() < 0.15
    assert pipeline.made_map() is not None  # joined by now


def test_a_drive_that_ends_while_it_joins_is_in_the_map() -> None:
    building, truth = first_day()
    again = drive(storey(1), ROUTE[::-1], day=1)
    pipeline = Pipeline(CONFIG, building=building, extends=True)
    for arrival in again.arrivals:
        if any(isinstance(event, PosePublished) for event in pipeline.process(arrival.measurement)):
            break
    assert pipeline.made_map() is None  # not yet joined
    result, events = pipeline.finish()
    assert not any(isinstance(event, Warned) for event in events)
    assert not result.is_separate
    assert off_m(result, again, building, truth).max() < 0.15
    assert len(result.building.keyframes) >= len(building.keyframes)


def test_in_another_building_the_drive_is_a_map_of_its_own() -> None:
    building, _ = first_day()
    other = drive(another_building(), ROUTE, day=1)
    result, events = estimated(other, building)
    assert not any(isinstance(event, PosePublished) for event in events)
    assert [e.text for e in events if isinstance(e, Warned)] == [
        "the robot was not found in the map: the drive is a map of its own"
    ]
    alone, _ = estimated(other)
    assert len(result.building.keyframes) == pytest.approx(len(alone.building.keyframes), abs=5)
    apart_m = np.hypot(*(result.final - alone.final)[:, :2].T)
    assert apart_m.max() < 0.2  # the map's calibration is the prior of the wheels


def test_a_map_without_wifi_is_gone_on_with_by_the_laser() -> None:
    building, truth = first_day()
    deaf = replace(building, fingerprints=[], weights={})
    again = drive(storey(1), ROUTE[::-1], day=1)
    result, events = estimated(again, deaf)
    if any(isinstance(event, PosePublished) for event in events):
        assert off_m(result, again, building, truth).max() < 0.3
    else:
        assert any("not found" in e.text for e in events if isinstance(e, Warned))


def test_another_mount_takes_only_what_the_drive_saw_with_the_wrong_one() -> None:
    """The loops that the map's own drive closed stay; so does where the robot is, until the map tells it again."""
    building, truth = first_day()
    again = drive(storey(1), ROUTE[::-1], day=1)
    mount = next(a for a in again.arrivals if isinstance(a.measurement, StaticTransforms))
    right = mount.measurement
    assert isinstance(right, StaticTransforms)
    turned = replace(
        right.transforms[0],
        translation_xyz=(0.4, 0.0, 0.2),
        rotation_xyzw=(0.0, 0.0, float(np.sin(0.05)), float(np.cos(0.05))),
    )
    wrong = replace(mount, measurement=replace(right, transforms=(turned,)))
    late_ns = right.stamp_ns + 50 * SECOND_NS
    corrected = replace(mount, measurement=replace(right, stamp_ns=late_ns))
    before = [a for a in again.arrivals if a is not mount and a.measurement.stamp_ns < late_ns]
    after = [a for a in again.arrivals if a.measurement.stamp_ns >= late_ns]
    result, events = estimated(replace(again, arrivals=[wrong, *before, corrected, *after]), building)
    assert [e.text for e in events if isinstance(e, Warned)] == [
        "the mount of 'laser' changed to (0.20 m, 0.00 m, +0.00 rad); the scans before are forgotten"
    ]
    removed = [e for e in events if isinstance(e, ClosureJudged) and e.verdict is Verdict.REMOVED]
    assert removed
    assert all(e.keyframe_b >= len(building.keyframes) for e in removed)
    assert not any(e.state is State.LOST for e in events if isinstance(e, StateChanged))
    off = off_m(result, again, building, truth)
    assert np.sqrt((off**2).mean()) < 0.2
    assert off[result.stamps_ns > late_ns + 5 * SECOND_NS].max() < 0.1


@pytest.mark.parametrize("moved", [False, True])
def test_what_the_unplaced_drive_claims_of_itself_is_not_told(moved: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """While the robot stands and is sought: but what a keyframe tells is of looking for it."""
    building, _ = first_day()
    core = ContinuedSlam(CONFIG, Calibration(calibration_prior(CONFIG.odometry), {}), untimed, building)
    told = StateChanged(0, State.TRACKING, "position known to 0.00 m")

    def look(core: SlamCore, point: PathPoint, _: PlacedScan) -> list[Event]:
        if moved:
            core.keyframes.append(Keyframe(point, None))
        return [told]

    monkeypatch.setattr(SlamCore, "look", look)
    scan = PlacedScan(ScanPoints(np.ones((1, 2)), np.ones((1, 2)), Pose2()), np.ones((1, 2), np.float32))
    assert core.look(PathPoint(0, Pose2(), 0.0), scan) == ([told] if moved else [])
