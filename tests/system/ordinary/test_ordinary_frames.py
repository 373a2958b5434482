"""Frames as ordinary robots send them: chains in any order and direction, roots of any name, mounts that come late."""

import math
from collections.abc import Callable, Iterable
from itertools import pairwise

import numpy as np
import pytest
from drives import Arrival, Simulated
from ordinary_drives import Fed, fed, renamed
from scipy.spatial.transform import Rotation

from wayfi.frontends.frames.pose3 import Pose3
from wayfi.frontends.measurements import (
    SECOND_NS,
    LaserScan,
    MovingTransforms,
    Odometry,
    StaticTransforms,
    Transform,
    WifiScan,
)
from wayfi.recordings.simulation.run import EPOCH_NS

SOUND_M = 0.02  # ATE of the minute; 0.005 where everything is right, and 0.1 with the laser at base_link
LATE_M = 0.03  # the same where some seconds go by the wheels alone
UPRIGHT = (0.0, 0.0, 0.0, 1.0)

Edge = tuple[str, str, Pose3]


def some_pose(rng: np.random.Generator) -> Pose3:
    return Pose3(Rotation.random(rng=rng).as_matrix(), rng.uniform(-0.5, 0.5, 3))


def transform(parent: str, child: str, T: Pose3, length: float = 1.0) -> Transform:
    x, y, z, w = length * Rotation.from_matrix(T.rotation).as_quat()
    tx, ty, tz = T.translation
    return Transform(parent, child, (float(tx), float(ty), float(tz)), (float(x), float(y), float(z), float(w)))


def mount_of(drive: Simulated) -> Pose3:
    """The laser's true mount, which is turned half round."""
    (told,) = (a.measurement for a in drive.arrivals if isinstance(a.measurement, StaticTransforms))
    return Pose3.of(told.transforms[0])


def chain(T: Pose3, frames: list[str], seed: int) -> list[Edge]:
    """Transforms from frame to frame that make up T, most of them tilted."""
    rng, edges, left = np.random.default_rng(seed), [], T
    for parent, child in pairwise(frames[:-1]):
        step = some_pose(rng)
        edges.append((parent, child, step))
        left = step.inverse() @ left
    return [*edges, (frames[-2], frames[-1], left)]


def backwards(edge: Edge) -> Edge:
    parent, child, T = edge
    return child, parent, T.inverse()


def static(at_s: float, *transforms: Transform) -> Arrival:
    at_ns = EPOCH_NS + round(at_s * SECOND_NS)
    return Arrival(at_ns, StaticTransforms(at_ns, transforms))


def moving(at_s: float, *transforms: Transform) -> Arrival:
    at_ns = EPOCH_NS + round(at_s * SECOND_NS)
    return Arrival(at_ns, MovingTransforms(at_ns, transforms, (at_ns,) * len(transforms)))


def without_mount(
    drive: Simulated, child: str = "base_link", scan_frame: str = "laser", odom: str = "odom"
) -> list[Arrival]:
    """The drive without its mount and WiFi, its frames renamed."""
    out = []
    for a in drive.without(StaticTransforms, WifiScan):
        if isinstance(a.measurement, Odometry):
            out.append(renamed(a, child_frame_id=child, frame_id=odom))
        else:
            out.append(renamed(a, frame_id=scan_frame))
    return out


def assert_right(drive: Simulated, arrivals: Iterable[Arrival], bound_m: float = SOUND_M) -> Fed:
    done = fed(arrivals)
    assert done.ate_m(drive.truth) < bound_m
    return done


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize(
    "send",
    [
        lambda edges: [static(0.0, *(transform(*e) for e in edges))],
        lambda edges: [static(0.0, transform(*e)) for e in reversed(edges)],
        lambda edges: [static(0.0, *(transform(*backwards(e)) for e in edges))],
        lambda edges: [static(0.0, transform(*edges[0], 0.3), *(transform(*backwards(e), 7.0) for e in edges[1:]))],
        lambda edges: [static(0.0, transform("/" + e[0], "/" + e[1], e[2])) for e in edges],
    ],
    ids=["one message", "one each, last first", "inverted", "mixed, of any norm", "leading slashes"],
)
def test_a_chain_of_transforms_leads_to_the_laser(
    send: Callable[[list[Edge]], list[Arrival]], seed: int, minute: Simulated
) -> None:
    edges = chain(mount_of(minute), ["base_link", "plate", "mast", "laser"], seed)
    done = assert_right(minute, send(edges) + without_mount(minute, scan_frame="/laser"))
    assert not any("mount" in text or "transform" in text for text in done.told)


@pytest.mark.parametrize("child", ["base_footprint", "/base_footprint", "robot1/base_link", "chassis"])
def test_the_root_is_the_frame_whose_pose_the_odometry_gives(child: str, minute: Simulated) -> None:
    edges = chain(mount_of(minute), [child, "top", "laser"], seed=3)
    sent = [static(0.0, *(transform(*edge) for edge in edges))]
    done = assert_right(minute, sent + without_mount(minute, child=child))
    assert not any("transform" in text for text in done.told)


def test_the_root_may_be_configured(minute: Simulated) -> None:
    sent = [
        static(0.0, transform("chassis", "laser", mount_of(minute)), transform("base_link", "lamp", Pose3.identity()))
    ]
    arrivals = sent + without_mount(minute, child="wheels")
    assert fed(arrivals, "odometry.base_frame=/chassis").ate_m(minute.truth) < SOUND_M


@pytest.mark.parametrize("child", ["base_footprint", "robot1/base", "wheel_odometry"])
def test_an_odometry_of_another_base_is_taken_for_base_link_and_that_is_told(child: str, minute: Simulated) -> None:
    sent = [static(0.0, transform("base_link", "laser", mount_of(minute)))]
    done = assert_right(minute, sent + without_mount(minute, child=child))
    (told,) = [text for text in done.told if "transform" in text]
    assert told.startswith(f"no transform leads from '{child}', whose pose the odometry gives, to 'laser'; 'base_link'")


def test_a_broken_chain_is_told_once_with_the_frames_that_are_known(minute: Simulated) -> None:
    first, _, last = chain(mount_of(minute), ["base_link", "plate", "mast", "laser"], seed=4)
    done = fed([static(0.0, transform(*first)), static(0.0, transform(*last)), *without_mount(minute)])
    assert [text for text in done.told if "transform" in text] == [
        "no transform leads from 'base_link' to 'laser': known are 'base_link', 'plate', 'mast', 'laser';"
        " base_link is assumed (see lidar.mount)"
    ]


@pytest.mark.parametrize("hz", [1.0, 50.0])
def test_transforms_of_tf_that_never_change_are_fixed(hz: float, minute: Simulated) -> None:
    edges = chain(mount_of(minute), ["base_link", "plate", "laser"], seed=5)
    sent = []
    for k in range(round(60 * hz)):
        wheel = Pose3(Rotation.from_euler("y", 0.1 * k).as_matrix(), np.array([0.1, 0.2, 0.0]))
        drives = Pose3(np.eye(3), np.array([0.01 * k, 0.0, 0.0]))
        sent.append(moving(k / hz, *(transform(*edge) for edge in edges)))
        sent.append(moving(k / hz, transform("base_link", "wheel", wheel), transform("map", "odom", drives)))
    done = assert_right(minute, sent + without_mount(minute))
    assert not any("mount" in text or "transform" in text for text in done.told)


def test_a_laser_over_a_joint_that_moves_is_told(minute: Simulated) -> None:
    nods = [Pose3(Rotation.from_euler("y", 0.02 * k).as_matrix(), np.zeros(3)) for k in range(60)]
    sent = [moving(float(k), transform("base_link", "head", T)) for k, T in enumerate(nods)]
    done = fed([static(0.0, transform("head", "laser", mount_of(minute))), *sent, *without_mount(minute)])
    assert sum("the way to 'laser' moves" in text for text in done.told) == 1


@pytest.mark.parametrize("at_s", [0.3, 0.9])
def test_scans_wait_briefly_for_their_mount(at_s: float, minute: Simulated) -> None:
    late = static(at_s, transform("base_link", "laser", mount_of(minute)))
    done = assert_right(minute, [late, *without_mount(minute)])
    assert not any("mount" in text for text in done.told)


@pytest.mark.parametrize("at_s", [3.0, 6.0, 12.0])
def test_scans_with_a_mount_that_came_too_late_are_forgotten(at_s: float, minute: Simulated) -> None:
    late = [
        static(at_s + k / 10, transform(*e))
        for k, e in enumerate(chain(mount_of(minute), ["base_link", "a", "laser"], 6))
    ]
    done = assert_right(minute, late + without_mount(minute), LATE_M)
    (told,) = [text for text in done.told if "known only now" in text]
    assert told.endswith("the scans before are forgotten")


def test_scans_with_a_mount_that_was_corrected_are_forgotten(minute: Simulated) -> None:
    wrong = static(0.0, transform("base_link", "laser", Pose3.identity()))
    right = static(20.0, transform("base_link", "laser", mount_of(minute)))
    done = assert_right(minute, [wrong, right, *without_mount(minute)], 0.07)  # a third of the way by the wheels alone
    assert sum("the mount of 'laser' changed to" in text for text in done.told) == 1


def test_a_laser_that_leads_begins_anew_with_a_mount_that_comes_late(minute: Simulated) -> None:
    late = static(8.0, transform("base_link", "laser", mount_of(minute)))
    scans = [a for a in without_mount(minute) if isinstance(a.measurement, LaserScan)]
    done = fed([late, *scans])
    assert sum("known only now" in text for text in done.told) == 1
    stamps = done.trajectory.stamps_ns
    assert np.isfinite(done.trajectory.poses).all()
    assert len(stamps) > 500


def test_a_robot_without_transforms_begins_with_the_laser_at_base_link(minute: Simulated) -> None:
    done = fed(without_mount(minute))
    assert [text for text in done.told if "mounted" in text] == [
        "no /tf_static says where 'laser' is mounted; base_link is assumed (see lidar.mount)"
    ]


HALF_ROUND = Pose3(np.diag([-1.0, -1.0, 1.0]), np.zeros(3))
LOOP = [("base_link", "a"), ("a", "b"), ("b", "base_link")]


@pytest.mark.parametrize(
    ("odd", "reason"),
    [
        ([transform(*pair, some_pose(np.random.default_rng(k))) for k, pair in enumerate(LOOP)], "loop_of_frames"),
        ([transform("mast", "laser", Pose3.identity()), transform("base_link", "mast", HALF_ROUND)], "loop_of_frames"),
        ([transform("laser", "laser", Pose3.identity())], "absurd_mount"),
        ([Transform("base_link", "lamp", (math.nan, 0.0, 0.0), UPRIGHT)], "non_finite"),
        ([Transform("base_link", f"lamp {k}", (0.0, 0.0, 0.0), UPRIGHT) for k in range(1100)], "too_many_frames"),
    ],
    ids=["cycle", "two parents", "self", "not finite", "thousands"],
)
def test_transforms_that_cannot_be_are_told_and_do_no_harm(
    odd: list[Transform], reason: str, minute: Simulated
) -> None:
    sent = [static(0.0, transform("base_link", "laser", mount_of(minute)))]
    sent += [static(0.1, *odd[k : k + 300]) for k in range(0, len(odd), 300)]
    done = assert_right(minute, sent + without_mount(minute))
    assert done.dropped["/tf_static"][reason] >= 1
    assert any("is not used: it" in text for text in done.told)
