"""The stream: the first scan is used, and the grid is redrawn at moments that depend on the measurements alone."""

import numpy as np
import pytest
from drives import Simulated

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.events import (
    ClosureKind,
    Dropped,
    DropReason,
    Event,
    GridRedrawn,
    KeyframeAdded,
    PosePublished,
    Warned,
)
from wayfi.frontends.measurements import InitialPose, LaserScan, Odometry, PoseFix, Sensor
from wayfi.frontends.pipeline import Pipeline
from wayfi.frontends.result import DriveEstimate
from wayfi.frontends.slam import SlamCore
from wayfi.frontends.switching_pipeline import SwitchingPipeline
from wayfi.recordings.trajectory import Trajectory
from wayfi.service.config import load_config
from wayfi.service.evaluation.trajectory_scores import absolute_error


def driven(drive: Simulated) -> tuple[list[Event], list[Event], DriveEstimate]:
    pipeline = Pipeline(load_config((), ()))
    events = [event for arrival in drive.arrivals for event in pipeline.process(arrival.measurement)]
    result, last = pipeline.finish()
    return events, last, result


def test_the_grid_is_redrawn_as_the_drive_goes_and_exact_at_its_end(minute: Simulated) -> None:
    events, last, result = driven(minute)
    live = [event for event in events if isinstance(event, GridRedrawn)]
    assert len(live) >= 3
    known = [(event.occupancy != 0.5).sum() for event in live]
    assert (np.diff(known) > 0).all()
    (final,) = (event for event in last if isinstance(event, GridRedrawn))
    np.testing.assert_array_equal(final.occupancy, result.building.grid.probability())
    assert (final.resolution_m, final.origin_xy_m) == (
        result.building.grid.resolution_m,
        result.building.grid.origin_xy_m,
    )


def test_a_redrawn_grid_follows_the_pose_of_its_moment(minute: Simulated) -> None:
    events, _, _ = driven(minute)
    for i, event in enumerate(events):
        if isinstance(event, GridRedrawn):
            before = events[i - 1]
            assert isinstance(before, PosePublished)
            assert before.stamp_ns == event.stamp_ns


def test_the_same_measurements_give_the_same_redraws(minute: Simulated) -> None:
    once, again = ([e for e in driven(minute)[0] if isinstance(e, GridRedrawn)] for _ in range(2))
    assert [e.stamp_ns for e in once] == [e.stamp_ns for e in again]
    for a, b in zip(once, again, strict=True):
        np.testing.assert_array_equal(a.occupancy, b.occupancy)


def test_without_a_laser_there_is_nothing_to_redraw(minute: Simulated) -> None:
    config = load_config((), ["lidar.enabled=false"])
    pipeline = Pipeline(config)
    events = [event for arrival in minute.arrivals for event in pipeline.process(arrival.measurement)]
    assert not any(isinstance(event, GridRedrawn) for event in events)


@pytest.mark.parametrize("odometry_first", [True, False])
def test_a_first_scan_stamped_like_the_first_odometry_is_used(odometry_first: bool) -> None:
    """Some robots stamp both from one clock tick; whichever of the two comes first."""
    stamp_ns = 1_000_000_000
    ranges = np.linspace(3.0, 5.0, 360, dtype=np.float32)
    scan = LaserScan(stamp_ns, "base_link", ranges, 0.0, 2 * np.pi / 360, 0.1, 30.0)
    odometry = Odometry(stamp_ns, Pose2())
    pipeline = Pipeline(load_config((), ()))
    arrivals = (odometry, scan) if odometry_first else (scan, odometry)
    events = [event for measurement in arrivals for event in pipeline.process(measurement)]
    with_scan = [e for e in events if isinstance(e, KeyframeAdded) and len(e.points)]
    assert [e.stamp_ns for e in with_scan] == [stamp_ns]


def test_an_initial_pose_of_a_drive_without_a_map_is_dropped_and_changes_nothing() -> None:
    pipeline = Pipeline(load_config((), ()))
    pipeline.process(Odometry(1_000_000_000, Pose2()))
    (event,) = pipeline.process(InitialPose(0, Pose2(5.0, 6.0, 1.0)))
    assert isinstance(event, Dropped)
    assert (event.sensor, event.reason, event.stamp_ns) == (Sensor.INITIAL_POSE, DropReason.NO_MAP, 1_000_000_000)
    published = [e for e in pipeline.process(Odometry(1_100_000_000, Pose2())) if isinstance(e, PosePublished)]
    assert published[0].T_map_base == Pose2()


def test_a_pose_that_is_claimed_between_two_odometry_messages_is_published_at_once(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    pipeline = Pipeline(load_config((), ()))
    scan = LaserScan(1_200_000_000, "laser", np.full(10, 2.0, np.float32), 0.0, 0.1, 0.1, 30.0)
    with monkeypatch.context() as patch:
        patch.setattr(SlamCore, "anchor", lambda _: None)
        unclaimed = [*pipeline.process(Odometry(1_000_000_000, Pose2())), *pipeline.process(scan)]
    claimed, after = ([e for e in pipeline.process(scan) if isinstance(e, PosePublished)] for _ in range(2))
    assert not any(isinstance(event, PosePublished) for event in unclaimed)
    assert [event.stamp_ns for event in claimed] == [1_000_000_000]
    assert after == []
    result, _ = pipeline.finish()
    np.testing.assert_array_equal(result.online, np.zeros((1, 3)))


def test_without_anything_of_a_map_there_is_nothing_to_localise_in() -> None:
    pipeline = SwitchingPipeline(load_config((), ()))
    (warned,) = pipeline.switch(localises=True)
    assert isinstance(warned, Warned)
    assert "nothing of a map yet" in warned.text
    assert not pipeline.localises
    assert pipeline.switch(localises=False) == []


def fixed(drive: Simulated, every: int, moved: Pose2 = Pose2()) -> DriveEstimate:
    """A drive without laser and WiFi, with a fix of the true pose at each `every`-th message of odometry."""
    pipeline = Pipeline(load_config((), ["lidar.enabled=false", "wifi.enabled=false"]))
    T_truth_map = Pose2.of(drive.truth.poses[0])
    odometry = 0
    for arrival in drive.arrivals:
        m = arrival.measurement
        pipeline.process(m)
        odometry += isinstance(m, Odometry)
        if isinstance(m, Odometry) and odometry % every == 0:
            true = Pose2.of(drive.truth.at(np.array([m.stamp_ns]))[0])
            T_map_base = moved @ T_truth_map.between(true)
            pipeline.process(PoseFix(m.stamp_ns, T_map_base, np.diag([0.05**2, 0.05**2, 0.02**2])))
    return pipeline.finish()[0]


def ate_m(result: DriveEstimate, drive: Simulated) -> float:
    return absolute_error(Trajectory(result.stamps_ns, result.final), drive.truth).error.ate_rmse_m


def test_fixes_from_outside_hold_the_drive_where_it_is(minute: Simulated) -> None:
    without, some = fixed(minute, 10**9), fixed(minute, 100)
    assert ate_m(some, minute) < min(0.1, 0.3 * ate_m(without, minute))
    kinds = {closure.judged.kind for closure in some.building.closures}
    assert kinds == {ClosureKind.FIX}


def test_fixes_in_a_frame_of_their_own_change_nothing(minute: Simulated) -> None:
    without, foreign = fixed(minute, 10**9), fixed(minute, 60, moved=Pose2(30.0, -4.0, 1.0))
    np.testing.assert_array_equal(foreign.final, without.final)
