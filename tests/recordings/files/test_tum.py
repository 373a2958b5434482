import math
from decimal import Decimal
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from wayfi.backend.pose2 import wrap_all
from wayfi.recordings.files.tum import TrajectoryError, read_tum, seconds_text, stamp_of, write_tum

STAMPS = st.integers(-(2**63), 2**63 - 1)
POSES = st.tuples(
    st.floats(-1e5, 1e5), st.floats(-1e5, 1e5), st.floats(-math.pi, math.pi, exclude_max=True, allow_subnormal=False)
)


@given(STAMPS)
@settings(deadline=None)
def test_a_stamp_comes_back_to_the_nanosecond(stamp_ns: int) -> None:
    text = seconds_text(stamp_ns)
    assert stamp_of(text) == stamp_ns
    assert Decimal(text) * 10**9 == stamp_ns
    assert len(text.partition(".")[2]) == 9


@given(st.lists(st.tuples(STAMPS, POSES), min_size=1, max_size=30, unique_by=lambda row: row[0]))
@settings(deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_a_trajectory_comes_back(tmp_path: Path, rows: list[tuple[int, tuple[float, float, float]]]) -> None:
    rows.sort()
    stamps_ns, poses = np.array([row[0] for row in rows], np.int64), np.array([row[1] for row in rows])
    write_tum(tmp_path / "t.tum", stamps_ns, poses)
    trajectory = read_tum(tmp_path / "t.tum")
    np.testing.assert_array_equal(trajectory.stamps_ns, stamps_ns)
    np.testing.assert_allclose(trajectory.poses[:, :2], poses[:, :2], rtol=0, atol=6e-10)
    np.testing.assert_allclose(wrap_all(trajectory.poses[:, 2] - poses[:, 2]), 0, atol=3e-9)


def test_a_line_reads_as_promised(tmp_path: Path) -> None:
    stamps_ns = np.array([1_700_000_000_123_456_789], np.int64)
    write_tum(tmp_path / "t.tum", stamps_ns, np.array([[1.5, -0.0, math.pi / 2]]))
    expected = "1700000000.123456789 1.500000000 0.000000000 0 0 0 0.707106781 0.707106781\n"
    assert (tmp_path / "t.tum").read_text() == expected


def test_comments_tilt_and_disorder_are_borne(tmp_path: Path) -> None:
    (tmp_path / "t.tum").write_text("# t x y\n2 1 1 0 0 0 2 0\n\n1.5e0 0 0 9 0.1 0 0 1\n")
    trajectory = read_tum(tmp_path / "t.tum")
    np.testing.assert_array_equal(trajectory.stamps_ns, [1_500_000_000, 2_000_000_000])
    np.testing.assert_allclose(trajectory.poses, [[0, 0, 0], [1, 1, math.pi]], atol=1e-12)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "# only a comment\n",
        "1 2 3\n",
        "1 0 0 0 0 0 0 1 9\n",
        "1 nan 0 0 0 0 0 1\n",
        "nan 0 0 0 0 0 0 1\n",
        "inf 0 0 0 0 0 0 1\n",
        "1 0 0 0 0 0 0 0\n",
        "1e30 0 0 0 0 0 0 1\n",
        "a b c d e f g h\n",
    ],
)
def test_what_is_no_trajectory_is_refused_by_name(tmp_path: Path, text: str) -> None:
    path = tmp_path / "bad.tum"
    path.write_text(text)
    with pytest.raises(TrajectoryError, match=r"bad\.tum"):
        read_tum(path)


def test_an_empty_trajectory_is_read_where_it_may_be_empty(tmp_path: Path) -> None:
    write_tum(tmp_path / "empty.tum", np.empty(0, np.int64), np.empty((0, 3)))
    empty = read_tum(tmp_path / "empty.tum", may_be_empty=True)
    assert (empty.stamps_ns.shape, empty.poses.shape) == ((0,), (0, 3))
    with pytest.raises(TrajectoryError, match="no pose in it"):
        read_tum(tmp_path / "empty.tum")


def test_a_missing_or_binary_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "binary.tum").write_bytes(b"\xff\xfe\x00\x89MCAP")
    for name in ("binary.tum", "missing.tum"):
        with pytest.raises(TrajectoryError, match=name):
            read_tum(tmp_path / name)
