"""The tree of transforms: any way between two frames is composed, whatever the order, the direction and the names."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from wayfi.frontends.frames.frame_tree import MOST_CHANGES, MOST_FRAMES, Added, FrameTree, frame_name, leaf_name
from wayfi.frontends.frames.pose3 import Pose3
from wayfi.frontends.measurements import Transform

UPRIGHT = (0.0, 0.0, 0.0, 1.0)


def at(parent: str, child: str, x: float = 0.0) -> Transform:
    return Transform(parent, child, (x, 0.0, 0.0), UPRIGHT)


def transform(parent: str, child: str, T: Pose3, length: float) -> Transform:
    x, y, z, w = (length * Rotation.from_matrix(T.rotation).as_quat()).tolist()
    tx, ty, tz = T.translation.tolist()
    return Transform(parent, child, (tx, ty, tz), (x, y, z, w))


@given(st.integers(2, 12), st.integers(0, 2**32 - 1), st.booleans())
def test_between_any_two_frames_the_transforms_are_composed(frames: int, seed: int, declared: bool) -> None:
    rng, tree = np.random.default_rng(seed), FrameTree()
    T_root = [Pose3(Rotation.random(rng=rng).as_matrix(), rng.uniform(-2.0, 2.0, 3)) for _ in range(frames)]
    pairs = [(int(rng.integers(k)), k) for k in range(1, frames)]
    for a, b in rng.permutation(pairs).tolist():
        a, b = (a, b) if rng.random() < 0.5 else (b, a)
        t = transform(f"/f{a}", f"f{b}", T_root[a].inverse() @ T_root[b], rng.uniform(0.1, 10.0))
        assert tree.add(t, declared) is Added.NEW
        assert tree.add(t, declared) is Added.KNOWN
    a, b = rng.integers(frames, size=2).tolist()
    found = tree.between(f"f{a}", f"f{b}")
    assert found is not None
    assert not found.differs(T_root[a].inverse() @ T_root[b], 1e-9, 1e-7)
    assert set(tree.frames) == {f"f{k}" for k in range(frames)}
    assert len(tree.pairs) == frames - 1


def test_frames_that_nothing_joins_are_not_reached() -> None:
    tree = FrameTree()
    tree.add(at("base_link", "plate"))
    tree.add(at("mast", "laser"))
    assert tree.between("base_link", "laser") is None
    assert tree.between("base_link", "nowhere") is None
    assert "mast" in tree


@pytest.mark.parametrize("moves_first", [True, False])
def test_a_transform_of_tf_that_changes_is_taken_out_for_good(moves_first: bool) -> None:
    tree = FrameTree()
    assert tree.add(at("base_link", "laser", 0.1), declared=False) is Added.NEW
    assert tree.add(at("base_link", "laser", 0.1 + 1e-6), declared=False) is Added.KNOWN
    assert tree.add(at("base_link", "laser", 0.2), declared=False) is Added.MOVES
    assert tree.between("base_link", "laser") is None
    assert tree.add(at("base_link", "laser", 0.1), declared=False) is Added.MOVES
    assert tree.frames == []
    if moves_first:
        assert tree.add(at("base_link", "laser", 0.3)) is Added.NEW
        assert tree.between("base_link", "laser") is not None


def test_a_declared_transform_goes_before_one_of_tf() -> None:
    tree = FrameTree()
    assert tree.add(at("base_link", "laser", 0.1), declared=False) is Added.NEW
    assert tree.add(at("base_link", "laser", 0.5)) is Added.NEW
    assert tree.add(at("base_link", "laser", 0.1), declared=False) is Added.KNOWN
    found = tree.between("base_link", "laser")
    assert found is not None
    assert found.translation[0] == 0.5


def test_odometry_that_still_stands_does_not_keep_a_declared_transform_out() -> None:
    tree = FrameTree()
    for child in ("base_footprint", "base_link"):
        tree.add(at("odom", child, 1.0 if child == "base_link" else 2.0), declared=False)
    assert tree.add(at("base_footprint", "base_link")) is Added.NEW
    for child in ("base_footprint", "base_link"):
        assert tree.add(at("odom", child, 3.0), declared=False) is Added.MOVES
    found = tree.between("base_footprint", "base_link")
    assert found is not None
    assert found.translation[0] == 0.0


def test_a_second_parent_that_agrees_is_nothing_new_and_one_that_contradicts_is_refused() -> None:
    tree = FrameTree()
    tree.add(at("base_link", "laser", 0.3))
    tree.add(at("base_link", "mast", 0.1))
    assert tree.add(at("mast", "laser", 0.2)) is Added.KNOWN
    assert tree.add(at("mast", "laser", 0.9)) is Added.LOOP


def test_a_declared_transform_changes_a_few_times_at_most() -> None:
    tree = FrameTree()
    assert tree.add(at("base_link", "laser")) is Added.NEW
    for k in range(MOST_CHANGES):
        assert tree.add(at("base_link", "laser", 1.0 + k)) is Added.CHANGED
    assert tree.add(at("base_link", "laser")) is Added.RESTLESS


@pytest.mark.parametrize("declared", [True, False])
def test_frames_are_bounded(declared: bool) -> None:
    tree = FrameTree()
    added = [tree.add(at("base_link", f"f{k}"), declared) for k in range(MOST_FRAMES + 10)]
    assert added[-10:] == [Added.TOO_MANY] * 10
    moved = [tree.add(at("base_link", f"f{k}", 1.0), declared=False) for k in range(MOST_FRAMES)]
    assert tree.add(at("base_link", "one more"), declared) is Added.TOO_MANY
    assert moved == [Added.KNOWN if declared else Added.MOVES] * MOST_FRAMES


@pytest.mark.parametrize(("parent", "child"), [("", "laser"), ("/", "laser"), ("laser", "/laser")])
def test_names_that_cannot_be(parent: str, child: str) -> None:
    assert FrameTree().add(at(parent, child)) is Added.ABSURD


def test_names() -> None:
    assert frame_name("/base_link") == "base_link"
    assert frame_name("robot1/base_link") == "robot1/base_link"
    assert leaf_name("robot1/base_link") == "base_link"
    assert leaf_name("base_link") == "base_link"
