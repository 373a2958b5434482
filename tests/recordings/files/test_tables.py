import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.events import ClosureJudged, ClosureKind, Verdict
from wayfi.recordings.files.tables import RadioPlace, TableError, read_closures, write_closures, write_radio

HEADER = (
    "stamp_a_ns,stamp_b_ns,kind,proposed_by,similarity,residual_m,inlier_ratio,dx_m,dy_m,dtheta_rad,"
    "cxx,cxy,cxt,cyy,cyt,ctt,verdict,reason"
)
COVARIANCE = np.array([[0.04, 0.01, 0.001], [0.01, 0.09, 0.002], [0.001, 0.002, 0.0025]])


def judged(closure: int = 0, verdict: Verdict = Verdict.ACCEPTED, **changes: object) -> ClosureJudged:
    fields: dict[str, object] = {
        "closure": closure,
        "stamp_a_ns": 1_000_000_001,
        "stamp_b_ns": 90_000_000_002,
        "keyframe_a": 3,
        "keyframe_b": 70,
        "kind": ClosureKind.LIDAR,
        "proposed_by": "wifi",
        "similarity": 0.61234,
        "residual_m": 0.02,
        "inlier_ratio": 0.8,
        "T_a_b": Pose2(1.0, -2.0, 0.5),
        "covariance": COVARIANCE,
        "heading_claimed": True,
        "verdict": verdict,
        "reason": "consistent",
    }
    return ClosureJudged(**{**fields, **changes})  # type: ignore[arg-type]


def test_the_header_stands_alone_without_candidates(tmp_path: Path) -> None:
    write_closures(tmp_path / "closures.csv", [])
    assert (tmp_path / "closures.csv").read_bytes() == HEADER.encode() + b"\n"
    assert read_closures(tmp_path / "closures.csv") == []


def test_a_row_reads_as_promised(tmp_path: Path) -> None:
    write_closures(tmp_path / "closures.csv", [judged()])
    expected = (
        "1000000001,90000000002,lidar,wifi,0.6123,0.0200,0.8000,1.000000,-2.000000,0.500000,4.000000e-02,1.000000e-02,"
        "1.000000e-03,9.000000e-02,2.000000e-03,2.500000e-03,accepted,consistent"
    )
    assert (tmp_path / "closures.csv").read_text().splitlines()[1] == expected


@given(
    st.floats(-1e4, 1e4),
    st.floats(-math.pi, math.pi, exclude_max=True),
    st.text(st.characters(codec="utf-8", exclude_categories=["C"])),
    st.booleans(),
    st.sampled_from(Verdict),
)
@settings(deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_a_candidate_comes_back(
    tmp_path: Path, x: float, theta: float, reason: str, claimed: bool, verdict: Verdict
) -> None:
    write_closures(
        tmp_path / "c.csv",
        [judged(T_a_b=Pose2(x, 2.0, theta), reason=reason, heading_claimed=claimed, verdict=verdict)],
    )
    (row,) = read_closures(tmp_path / "c.csv")
    assert (row.stamp_a_ns, row.stamp_b_ns, row.reason, row.verdict) == (1_000_000_001, 90_000_000_002, reason, verdict)
    assert row.heading_claimed == claimed
    expected = [x, 2.0, theta if claimed else 0.0]
    np.testing.assert_allclose(row.T_a_b.array(), expected, atol=1e-6)
    shown = 3 if claimed else 2
    np.testing.assert_allclose(row.covariance[:shown, :shown], COVARIANCE[:shown, :shown], rtol=1e-6)
    assert np.isnan(row.covariance[2]).all() != claimed


def test_a_heading_that_is_not_claimed_is_left_empty(tmp_path: Path) -> None:
    write_closures(tmp_path / "c.csv", [judged(heading_claimed=False, residual_m=math.nan)])
    words = (tmp_path / "c.csv").read_text().splitlines()[1].split(",")
    row = dict(zip(HEADER.split(","), words, strict=True))
    assert [row[name] for name in ("dtheta_rad", "cxt", "cyt", "ctt", "residual_m")] == [""] * 5
    assert row["cyy"] == "9.000000e-02"


def test_a_removed_closure_takes_its_row_over(tmp_path: Path) -> None:
    removed = judged(1, Verdict.REMOVED, reason="bent the map")
    write_closures(tmp_path / "c.csv", [judged(0), judged(1), judged(2, Verdict.REFUSED), removed])
    rows = read_closures(tmp_path / "c.csv")
    assert [row.verdict for row in rows] == [Verdict.ACCEPTED, Verdict.REMOVED, Verdict.REFUSED]
    assert rows[1].reason == "bent the map"


@pytest.mark.parametrize(
    "text",
    [
        "",
        "a,b\n1,2\n",
        HEADER + "\n1,2,lidar\n",
        HEADER + "\nx,2,lidar,wifi,,,,,,,,,,,,,accepted,\n",
        HEADER + "\n1,2,sonar,wifi,,,,,,,,,,,,,accepted,\n",
        HEADER + "\n1,2,lidar,wifi,,,,,,,,,,,,,maybe,\n",
    ],
)
def test_what_is_no_closure_table_is_refused_by_name(tmp_path: Path, text: str) -> None:
    path = tmp_path / "broken.csv"
    path.write_text(text)
    with pytest.raises(TableError, match=r"broken\.csv"):
        read_closures(path)
    with pytest.raises(TableError, match=r"missing\.csv"):
        read_closures(tmp_path / "missing.csv")


def test_radio_has_a_row_for_each_reading(tmp_path: Path) -> None:
    rssi = np.array([-61.0, -70.25], np.float32)
    places = [RadioPlace(1_500_000_000, 1.0, -2.0, "wlan0, left", ("aa:bb:cc:dd:ee:ff", "00:11:22:33:44:55"), rssi)]
    write_radio(tmp_path / "radio.csv", places)
    assert (tmp_path / "radio.csv").read_text() == (
        "t,x,y,receiver,bssid,rssi\n"
        '1.500000000,1.000,-2.000,"wlan0, left",aa:bb:cc:dd:ee:ff,-61.00\n'
        '1.500000000,1.000,-2.000,"wlan0, left",00:11:22:33:44:55,-70.25\n'
    )


def test_radio_without_wifi_is_its_header(tmp_path: Path) -> None:
    write_radio(tmp_path / "radio.csv", [])
    assert (tmp_path / "radio.csv").read_bytes() == b"t,x,y,receiver,bssid,rssi\n"
