"""What robots in the experiments hear: from a moment on, kidnapped, with another mount, among other access points."""

from itertools import pairwise

import numpy as np
import pytest
from benchmarks.localization.changes import access_points_moved, all_access_points_replaced, another_mount
from benchmarks.localization.drives import Drive, records, stream
from benchmarks.localization.kidnapping import CARRIED_S, PIECE_S, joined, pieces
from buildings.robots import drive
from buildings.storey import ROUTE, storey
from drives import write

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.measurements import LaserScan, Measurement, Odometry, Sensor, StaticTransforms, WifiScan
from wayfi.recordings.files.tum import write_tum

STEP_M = 0.08  # a tenth of a second, and some noise
LATER_NS = 40_000_000_000


@pytest.fixture(scope="module")
def driven(tmp_path_factory: pytest.TempPathFactory) -> Drive:
    folder = tmp_path_factory.mktemp("driven")
    made = drive(storey(), ROUTE, day=0)
    write(folder / "recording.mcap", made.arrivals)
    write_tum(folder / "truth.tum", made.truth.stamps_ns, made.truth.poses)
    return Drive(folder)


def heard(driven: Drive, *without: Sensor) -> list[Measurement]:
    start_ns = int(driven.truth.stamps_ns[0]) + LATER_NS
    return list(stream(records(driven.recording), start_ns, start_ns + LATER_NS, without))


def poses(measured: list[Measurement]) -> list[Pose2]:
    return [m.pose for m in measured if isinstance(m, Odometry)]


def test_a_robot_hears_its_mount_first_and_then_what_comes_from_its_start_on(driven: Drive) -> None:
    measured = heard(driven)
    assert isinstance(measured[0], StaticTransforms)
    assert measured[1].stamp_ns == driven.truth.stamps_ns[0] + LATER_NS
    assert len(poses(measured)) == 400
    assert not any(isinstance(m, LaserScan) for m in heard(driven, Sensor.SCAN))


def test_the_odometry_of_a_kidnapped_robot_goes_on(driven: Drive) -> None:
    cut = pieces(driven, 4, seed=1)
    measured = list(joined(driven, cut))
    stamps = [m.stamp_ns for m in measured]
    assert stamps == sorted(stamps)
    steps = [a.distance(b) for a, b in pairwise(poses(measured))]
    assert max(steps) < STEP_M
    standing = [k for k, metres in enumerate(steps) if metres == 0.0]
    assert len(standing) >= 2 * (10 * CARRIED_S - 1)
    places = [piece.truth(driven.truth).at(np.array([piece.start_ns + piece.later_ns]))[0] for piece in cut]
    assert min(np.hypot(*(a - b)[:2]) for a, b in pairwise(places)) > 1.0
    assert (cut[-1].end_ns + cut[-1].later_ns - cut[0].start_ns) * 1e-9 > 4 * PIECE_S


def test_a_carried_robot_sees_the_old_place_and_then_the_new_one(driven: Drive) -> None:
    cut = pieces(driven, 2, seed=1)
    measured = list(joined(driven, cut))
    arrival_ns = cut[1].start_ns + cut[1].later_ns
    scans = [m for m in measured if isinstance(m, LaserScan)]
    carried = [m for m in scans if arrival_ns - CARRIED_S * 1e9 <= m.stamp_ns < arrival_ns]
    before, after = (
        next(m for m in order if m not in carried) for order in (_until(scans, arrival_ns), _from(scans, arrival_ns))
    )
    assert np.array_equal(carried[0].ranges, before.ranges)
    assert np.array_equal(carried[-1].ranges, after.ranges)
    assert not np.array_equal(before.ranges, after.ranges)


def _until(scans: list[LaserScan], stamp_ns: int) -> list[LaserScan]:
    return [m for m in scans if m.stamp_ns < stamp_ns][::-1]


def _from(scans: list[LaserScan], stamp_ns: int) -> list[LaserScan]:
    return [m for m in scans if m.stamp_ns >= stamp_ns]


def test_another_mount_and_its_base_are_the_same_laser_at_the_same_place(driven: Drive) -> None:
    T_old_new = Pose2(-0.2, 0.1, 0.4)
    old, new = heard(driven), list(another_mount(T_old_new)(heard(driven), []))
    motions = [(p[0].between(p[-1]) @ mount(m)).array() for m in (old, new) for p in [poses(m)]]
    T_first_laser = [mount(m) for m in (old, new)]
    moved = [first.inverse() @ Pose2.of(motion) for first, motion in zip(T_first_laser, motions, strict=True)]
    assert moved[0].array() == pytest.approx(moved[1].array(), abs=1e-6)
    assert driven.seen_from(T_old_new).truth.poses[0, 2] == pytest.approx(driven.truth.poses[0, 2] + 0.4)


def mount(measured: list[Measurement]) -> Pose2:
    static = next(m for m in measured if isinstance(m, StaticTransforms)).transforms[0]
    (x, y, _), (_, _, sine, cosine) = static.translation_xyz, static.rotation_xyzw
    return Pose2(x, y, 2 * float(np.arctan2(sine, cosine)))


def addresses(measured: list[Measurement]) -> list[str]:
    return [bssid for m in measured if isinstance(m, WifiScan) for bssid in m.bssids]


def test_of_replaced_access_points_none_is_known(driven: Drive) -> None:
    known = set(addresses(heard(driven)))
    assert not known & set(addresses(list(all_access_points_replaced(heard(driven), []))))


def test_moved_access_points_are_heard_where_others_were(driven: Drive) -> None:
    before = addresses(heard(driven))
    after = addresses(list(access_points_moved(0.3)(heard(driven), sorted(set(before)))))
    assert set(after) <= set(before)
    assert len(before) == len(after)
    assert 0.1 < np.mean([a != b for a, b in zip(before, after, strict=True)]) < 0.5
