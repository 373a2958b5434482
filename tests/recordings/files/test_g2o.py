"""graph.g2o as gtsam reads it: the same poses, and the same error of any estimate."""

from pathlib import Path

import gtsam
import numpy as np
import pytest

from wayfi.backend.graph.factors import BetweenFactor, Factor, NearFactor, WheelFactor
from wayfi.backend.graph.gtsam_factors import between_factor, calibration_key, near_factor, pose_key
from wayfi.backend.graph.wheel_calibration import WheelMotion
from wayfi.backend.pose2 import Floats, Pose2, between_all
from wayfi.recordings.files.g2o import write_g2o

CALIBRATION = np.array([0.01, 0.02, 0.03, 0.001])


def covariance(rng: np.random.Generator) -> Floats:
    A = rng.normal(0, 0.2, (3, 3))
    return np.asarray(A @ A.T + 0.01 * np.eye(3))


def graph(seed: int) -> tuple[Floats, list[Factor]]:
    """Six poses, wheels from each to the next, and two constraints across."""
    rng = np.random.default_rng(seed)
    poses = rng.uniform(-3, 3, (6, 3))
    factors: list[Factor] = [
        WheelFactor(k, k + 1, WheelMotion(Pose2(*rng.uniform(-1, 1, 3)), 0.7, 2.0), covariance(rng)) for k in range(5)
    ]
    factors += [BetweenFactor(a, b, Pose2(*rng.uniform(-3, 3, 3)), covariance(rng)) for a, b in ((0, 5), (4, 1))]
    return poses, factors


def values(poses: Floats, key: bool) -> gtsam.Values:
    out = gtsam.Values()
    for k, pose in enumerate(poses):
        out.insert(pose_key(k) if key else k, gtsam.Pose2(*pose))
    return out


@pytest.mark.parametrize("seed", range(4))
def test_what_gtsam_reads_has_the_poses_and_the_error_of_the_graph(tmp_path: Path, seed: int) -> None:
    poses, factors = graph(seed)
    path = tmp_path / "graph.g2o"
    write_g2o(path, poses, factors, CALIBRATION)
    path.write_text("".join(line for line in path.read_text().splitlines(True) if not line.startswith("FIX")))
    read, initial = gtsam.readG2o(str(path), False)
    found = np.array([[(p := initial.atPose2(k)).x(), p.y(), p.theta()] for k in range(len(poses))])
    np.testing.assert_allclose(between_all(poses, found), 0, atol=1e-7)
    ours = gtsam.NonlinearFactorGraph()
    for f in factors:
        assert not isinstance(f, NearFactor)
        T = f.T_a_b if isinstance(f, BetweenFactor) else f.motion.corrected(CALIBRATION)
        ours.add(between_factor(f.a, f.b, T, f.covariance))
    elsewhere = poses + np.random.default_rng(seed + 9).normal(0, 0.3, poses.shape)
    for at in (poses, elsewhere):
        assert read.error(values(at, key=False)) == pytest.approx(ours.error(values(at, key=True)), rel=1e-6)


def test_gtsam_reads_every_edge_of_the_file_as_it_is_written(tmp_path: Path) -> None:
    poses, factors = graph(0)
    write_g2o(tmp_path / "graph.g2o", poses, factors, CALIBRATION)
    assert gtsam.readG2o(str(tmp_path / "graph.g2o"), False)[0].size() == len(factors)


def test_a_line_reads_as_g2o_takes_it(tmp_path: Path) -> None:
    factor = BetweenFactor(0, 1, Pose2(1.5, -2.0, 0.0), np.diag([0.5, 0.25, 0.125]))
    write_g2o(tmp_path / "graph.g2o", np.array([[0.0, 0.0, 0.0], [1.5, -2.0, 0.0]]), [factor], np.zeros(4))
    lines = (tmp_path / "graph.g2o").read_text().splitlines()
    assert lines.count("FIX 0") == 1
    assert [line for line in lines if line != "FIX 0"] == [
        "VERTEX_SE2 0 0 0 0",
        "VERTEX_SE2 1 1.5 -2 0",
        "EDGE_SE2 0 1 1.5 -2 0 2 0 0 4 0 8",
    ]


def test_a_drive_without_keyframes_is_an_empty_graph(tmp_path: Path) -> None:
    write_g2o(tmp_path / "graph.g2o", np.empty((0, 3)), [], np.zeros(4))
    assert (tmp_path / "graph.g2o").read_text().strip() == ""


def test_two_places_that_are_one_leave_turning_open_and_weigh_distance_as_the_graph_does(tmp_path: Path) -> None:
    poses = np.array([[1.0, 2.0, 0.4], [4.0, -1.0, 2.0]])
    near = NearFactor(0, 1, np.array([0.3, -0.2]), np.array([-0.4, 0.5]), 0.8)
    path = tmp_path / "graph.g2o"
    write_g2o(path, poses, [near], np.zeros(4))
    line = next(line for line in path.read_text().splitlines() if line.startswith("EDGE"))
    x, y, theta, *upper = map(float, line.split()[3:])
    information = np.zeros((3, 3))
    information[np.triu_indices(3)] = upper
    information += np.triu(information, 1).T
    assert np.linalg.matrix_rank(information, tol=1e-6) == 2
    T = Pose2(x, y, theta)
    np.testing.assert_allclose(T.transform(near.place_b[None])[0], near.place_a, atol=1e-8)
    for step in ((0.05, 0.0, 0.0), (0.0, 0.05, 0.0), (0.0, 0.0, 0.01)):
        moved = Pose2(*poses[0]) @ T @ Pose2(*step)
        at = values(np.array([poses[0], moved.array()]), key=True)
        at.insert(calibration_key(0), np.zeros(4))
        expected = near_factor(near, 0).error(at)
        assert 0.5 * np.array(step) @ information @ np.array(step) == pytest.approx(expected, rel=0.02)
