"""The Rerun log: what was believed at a moment is what the file shows for it, in a file and live alike."""

import socket
import time
from collections import defaultdict
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rerun.chunk import Chunk, RrdReader
from rerun_events import KEYFRAMES_A_LAP, START_NS, drive

from wayfi.backend.errors import WayfiError
from wayfi.backend.pose2 import Floats, Pose2, wrap
from wayfi.frontends.events import (
    ClosureJudged,
    Dropped,
    DropReason,
    Event,
    GraphUpdated,
    GridRedrawn,
    KeyframeAdded,
    PosePublished,
    StateChanged,
    Verdict,
    Warned,
)
from wayfi.frontends.measurements import Sensor
from wayfi.recordings.log import Log
from wayfi.recordings.rerun.config import RerunConfig
from wayfi.recordings.rerun.rerun_log import RerunLog
from wayfi.recordings.rerun.viewer_process import free_port, viewer_process
from wayfi.recordings.rerun.views.submaps import MOVE_M, REDRAW_M

KEYFRAMES = KEYFRAMES_A_LAP + 90
SIZE = RerunConfig().submap_keyframes


@dataclass
class Driven:
    """A drive's log, and what was believed after each update, by stamp and number of keyframes."""

    rrd: Path
    events: list[Event]
    believed: dict[int, Floats] = field(default_factory=dict)


@pytest.fixture(scope="module")
def driven(tmp_path_factory: pytest.TempPathFactory) -> Driven:
    rrd = tmp_path_factory.mktemp("log") / "session.rrd"
    result = Driven(rrd, list(drive(KEYFRAMES, beams=150)))
    write(RerunLog(RerunConfig(), rrd), result.events)
    poses = np.zeros((0, 3))
    for event in result.events:
        if isinstance(event, KeyframeAdded):
            poses = np.vstack([poses, event.T_map_base.array()])
        if isinstance(event, GraphUpdated):
            poses = poses if event.poses is None else event.poses
            result.believed[event.keyframe] = poses
    return result


def write(log: Log, events: list[Event]) -> None:
    for event in events:
        log.log(event)
    log.log_durations({"wifi": 0.002, "backend": 0.004})
    log.close()


def chunks(rrd: Path, content: str = "/**") -> list[Chunk]:
    return list(RrdReader(rrd).stream().filter(content=content).to_chunks())


def rows(rrd: Path, content: str) -> list[dict[str, Any]]:
    """The rows below `content` that are not static, each with its entity, in the order they were logged."""
    found = [
        {"entity": chunk.entity_path, **row}
        for chunk in chunks(rrd, content)
        if not chunk.is_static
        for row in chunk.to_record_batch().to_pylist()
    ]
    return sorted(found, key=lambda row: row["rerun.controls.RowId"])


def latest(rrd: Path, content: str, component: str, keyframe: int) -> dict[str, Any]:
    """Entity -> `component` as the viewer shows it at `keyframe`."""
    shown: dict[str, Any] = {}
    for row in sorted(rows(rrd, content), key=lambda row: row["keyframe"]):
        if row["keyframe"] <= keyframe and row.get(component) is not None:
            shown[row["entity"]] = row[component]
    return shown


def frames(rrd: Path, keyframe: int) -> dict[int, Pose2]:
    """Submap -> the frame that its scans hang on, at `keyframe`."""
    places = latest(rrd, "/map/submaps/**", "Transform3D:translation", keyframe)
    turns = latest(rrd, "/map/submaps/**", "Transform3D:quaternion", keyframe)
    return {
        int(entity.rsplit("/", 1)[1]): Pose2(*places[entity][0][:2], 2 * np.arctan2(*turns[entity][0][2:]))
        for entity in places
    }


def test_every_entity_hangs_on_one_of_the_five_roots(driven: Driven) -> None:
    roots = {chunk.entity_path.split("/")[1] for chunk in chunks(driven.rrd)}
    assert roots - {"__properties"} == {"map", "wifi", "check", "backend", "log"}


def test_everything_is_on_both_timelines(driven: Driven) -> None:
    for chunk in chunks(driven.rrd):
        if not chunk.is_static:
            assert sorted(chunk.timeline_names) == ["keyframe", "stamp"], chunk.entity_path


def test_what_is_promised_is_there(driven: Driven) -> None:
    entities = {chunk.entity_path for chunk in chunks(driven.rrd)}
    for path in (
        "/map/robot", "/map/ellipse", "/map/scan", "/map/grid", "/map/local_submap", "/map/odometry/0000",
        "/map/submaps/0000", "/map/submaps/0000/path", "/map/submaps/0000/scans", "/wifi/rssi", "/wifi/similarity",
        "/wifi/places/similar", "/wifi/sequences/a", "/wifi/sequences/b", "/check/scans/before", "/check/scans/after",
        "/check/inlier_ratio/closure", "/backend/residual", "/backend/factors/in_and_out", "/backend/state",
        "/backend/time", "/log/verdicts", "/log/state", "/log/warnings", "/log/drops",
    ):  # fmt: skip
        assert path in entities
    assert {path.split("/")[3] for path in entities if path.startswith("/map/closures/")} == set(Verdict)


def test_the_blueprint_is_in_the_file(driven: Driven) -> None:
    reader = RrdReader(driven.rrd)
    assert [entry.application_id for entry in reader.recordings()] == ["wayfi"]
    (entry,) = reader.blueprints()
    paths = {chunk.entity_path for chunk in reader.stream(store=entry).to_chunks()}
    assert any(path.startswith("/view/") for path in paths)


@pytest.mark.parametrize("keyframe", [57, KEYFRAMES_A_LAP + 4, KEYFRAMES - 1])
def test_the_frames_are_where_the_graph_had_them(driven: Driven, keyframe: int) -> None:
    believed = driven.believed[keyframe]
    shown = frames(driven.rrd, keyframe)
    assert sorted(shown) == list(range(-(-len(believed) // SIZE)))
    for submap, T in shown.items():
        then = Pose2.of(believed[submap * SIZE])
        assert T.distance(then) < MOVE_M + 1e-5
        assert abs(wrap(T.theta - then.theta)) < np.deg2rad(0.2) + 1e-5


@pytest.mark.parametrize("keyframe", [57, KEYFRAMES_A_LAP + 4, KEYFRAMES - 1])
def test_the_path_below_the_frames_is_the_believed_one(driven: Driven, keyframe: int) -> None:
    believed = driven.believed[keyframe]
    shown = frames(driven.rrd, keyframe)
    paths = latest(driven.rrd, "/map/submaps/**", "Points2D:positions", keyframe)
    drawn = {int(entity.split("/")[3]): xy for entity, xy in paths.items() if entity.endswith("/path")}
    path = np.concatenate([shown[i].transform(np.array(drawn[i], float)) for i in sorted(drawn)])
    assert len(path) == len(believed)
    assert np.hypot(*(path - believed[:, :2]).T).max() < MOVE_M + REDRAW_M + 0.05


def test_a_correction_moves_frames_and_not_their_scans(driven: Driven) -> None:
    first_correction = next(
        i for i, event in enumerate(driven.events) if isinstance(event, GraphUpdated) and event.poses is not None
    )
    keyframe = driven.events[first_correction].keyframe  # type: ignore[union-attr]
    assert frames(driven.rrd, keyframe - 1)[15].distance(frames(driven.rrd, keyframe)[15]) > 10 * MOVE_M
    scans = [row for row in rows(driven.rrd, "/map/submaps/0015/scans") if row["keyframe"] >= 160]
    assert not scans


def test_closures_are_grouped_by_verdict_and_follow_their_keyframes(driven: Driven) -> None:
    verdicts: dict[int, ClosureJudged] = {e.closure: e for e in driven.events if isinstance(e, ClosureJudged)}
    believed = driven.believed[KEYFRAMES - 1]
    for verdict in Verdict:
        strips = latest(driven.rrd, f"/map/closures/{verdict}/**", "LineStrips2D:strips", KEYFRAMES)
        ends = [np.array(strip).reshape(-1) for group in strips.values() for strip in group]
        expected = [
            believed[[e.keyframe_a, e.keyframe_b], :2].reshape(-1) for e in verdicts.values() if e.verdict is verdict
        ]
        assert len(ends) == len(expected)
        apart = np.abs(np.array(ends)[:, None] - np.array(expected)[None]).max(axis=2)
        assert apart.min(axis=1).max() < 0.11


def test_every_verdict_is_in_the_text_log_with_its_reason(driven: Driven) -> None:
    texts = [row["TextLog:text"][0] for row in rows(driven.rrd, "/log/verdicts")]
    judged = [event for event in driven.events if isinstance(event, ClosureJudged)]
    assert len(texts) == len(judged)
    for text, event in zip(texts, judged, strict=True):
        assert f"closure {event.closure} {event.verdict}: {event.reason}" in text


def test_the_log_grows_linearly(tmp_path: Path) -> None:
    sizes = []
    for keyframes in (150, 300):
        rrd = tmp_path / f"{keyframes}.rrd"
        write(RerunLog(RerunConfig(), rrd), list(drive(keyframes, beams=150)))
        sizes.append(rrd.stat().st_size)
    assert sizes[1] < 2.4 * sizes[0]


@pytest.mark.filterwarnings("ignore:RRD file has no footer")  # the viewer that saves it is killed
def test_live_carries_what_the_file_carries(tmp_path: Path) -> None:
    config = replace(RerunConfig(), port=free_port())
    saved, live = tmp_path / "saved.rrd", tmp_path / "live.rrd"
    log = RerunLog(config, saved, serve=True)
    source = f"rerun+http://127.0.0.1:{config.port}/proxy"
    with viewer_process(["--port", str(free_port()), "--connect", source, "--save", str(live)]):
        for event in drive(30, beams=50):
            log.log(event)
        wait_until_quiet(live)
        log.close()
    assert row_counts(live) == row_counts(saved)


def wait_until_quiet(path: Path) -> None:
    size = -1
    for _ in range(60):
        time.sleep(1.0)
        now = path.stat().st_size if path.exists() else 0
        if now == size and now > 100_000:
            return
        size = now
    pytest.fail(f"{path} did not fill: {size} bytes")


def row_counts(rrd: Path) -> dict[str, int]:
    counts: dict[str, int] = defaultdict(int)
    for chunk in chunks(rrd):
        counts[chunk.entity_path] += chunk.num_rows
    return dict(counts)


def test_an_occupied_port_and_a_missing_folder_are_errors_in_one_line(tmp_path: Path) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        config = replace(RerunConfig(), port=taken.getsockname()[1])
        with pytest.raises(WayfiError, match=r"rerun\.port"):
            RerunLog(config, None, serve=True)
    with pytest.raises(WayfiError, match="nowhere"):
        RerunLog(RerunConfig(), tmp_path / "nowhere" / "session.rrd")


def test_odd_events_do_no_harm(tmp_path: Path) -> None:
    """A graph resumed from disk, keyframes without a scan, an unknown covariance, an empty grid."""
    rrd = tmp_path / "odd.rrd"
    resumed = np.stack([np.arange(25.0), np.zeros(25), np.zeros(25)], axis=1)
    unknown = np.full((3, 3), np.inf)
    state = next(e for e in drive(1) if isinstance(e, StateChanged)).state
    events: list[Event] = [
        Warned(0, "before anything"),
        Dropped(Sensor.ODOM, 2**62, DropReason.STAMP_BACK),
        GraphUpdated(START_NS, 24, resumed, 25, 0, 25, float("nan")),
        PosePublished(START_NS, Pose2(), Pose2(), Pose2(), unknown, state),
        KeyframeAdded(25, START_NS, Pose2(25.0), np.zeros((0, 2), np.float32), float("nan")),
        GridRedrawn(START_NS, np.zeros((0, 0), np.float32), 0.05, (0.0, 0.0)),
    ]
    write(RerunLog(RerunConfig(), rrd), events)
    assert len(frames(rrd, 25)) == 3
    stamps = {row["stamp"].year for row in rows(rrd, "/map/**")}
    assert stamps == {2023}


def test_drops_are_told_at_powers_of_ten_and_in_total(tmp_path: Path) -> None:
    rrd = tmp_path / "drops.rrd"
    write(RerunLog(RerunConfig(), rrd), [Dropped(Sensor.SCAN, START_NS, DropReason.NO_RETURN)] * 25)
    counts = [row["TextLog:text"][0].split("(")[1].split(" ")[0] for row in rows(rrd, "/log/drops")]
    assert counts == ["1", "10", "25"]
