"""The log that runs in a process of its own writes what the one beside would, and says when it cannot."""

import signal
from dataclasses import replace
from pathlib import Path

import pytest
from rerun.chunk import RrdReader
from rerun_events import drive

from wayfi.backend.graph.health import State
from wayfi.frontends.events import PosePublished
from wayfi.frontends.measurements import SECOND_NS
from wayfi.recordings.rerun import log_process
from wayfi.recordings.rerun.config import RerunConfig
from wayfi.recordings.rerun.log_process import LogProcess, LogProcessError, Part
from wayfi.recordings.rerun.rerun_log import RerunLog

EVENTS = list(drive(40, 60))
CONFIG = replace(RerunConfig(), scan_points=50)


def entities(path: Path) -> dict[str, int]:
    """Rows by entity."""
    rows: dict[str, int] = {}
    for chunk in RrdReader(path).stream().to_chunks():
        rows[chunk.entity_path] = rows.get(chunk.entity_path, 0) + chunk.num_rows
    return rows


def log_all_and_close(log: LogProcess | RerunLog) -> None:
    for event in EVENTS:
        log.log(event)
    log.log_durations({"wifi": 0.002})
    log.close()


def test_the_file_holds_what_a_log_in_this_process_holds(tmp_path: Path) -> None:
    beside, here = (
        LogProcess(Part(CONFIG, tmp_path / "a.rrd", "one")),
        RerunLog(CONFIG, tmp_path / "b.rrd", False, "one"),
    )
    for log in (beside, here):
        log_all_and_close(log)
    assert entities(tmp_path / "a.rrd") == entities(tmp_path / "b.rrd")


def test_a_file_that_cannot_be_written_is_one_clear_line(tmp_path: Path) -> None:
    log = LogProcess(Part(CONFIG, tmp_path / "no" / "such" / "folder" / "a.rrd", "one"))
    with pytest.raises(LogProcessError, match="the log ended early"):
        log_all_and_close(log)


@pytest.mark.parametrize("events", [1, 20_000])
def test_a_process_that_writes_no_more_is_not_waited_for(
    events: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(log_process, "STALLED_S", 0.5)
    log = LogProcess(Part(CONFIG, tmp_path / "a.rrd", "one"))
    log._process.send_signal(signal.SIGSTOP)  # as Rerun does on a full disk

    def log_and_close() -> None:
        for number in range(events):
            log.log(EVENTS[number % len(EVENTS)])
        log.close()

    with pytest.raises(LogProcessError, match=r"a\.rrd: cannot be written to its end"):
        log_and_close()


def test_of_poses_that_nothing_follows_from_those_are_sent_that_are_drawn() -> None:
    poses = [event for event in EVENTS if isinstance(event, PosePublished)]
    still = [replace(poses[0], stamp_ns=poses[0].stamp_ns + n * SECOND_NS // 10) for n in range(60)]
    lost = replace(still[-1], stamp_ns=still[-1].stamp_ns + 1, state=State.LOST)
    drawn = log_process._DrawnPoses(CONFIG.pose_hz)
    assert [pose for event in [*still, lost] for pose in drawn.of(event)] == [*still[::10], lost]
