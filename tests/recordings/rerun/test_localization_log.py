"""A log of localisation: hypotheses until one is claimed, and the robot only while its pose is known."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rerun.chunk import RrdReader

from wayfi.backend.graph.health import State
from wayfi.backend.pose2 import Pose2
from wayfi.frontends.events import HypothesesFollowed, PosePublished, StateChanged
from wayfi.recordings.rerun.config import RerunConfig
from wayfi.recordings.rerun.rerun_log import RerunLog

SECOND_NS = 1_000_000_000
TWO_PLACES = np.array([[1.0, 2.0, 0.0], [31.0, 2.0, 0.0]])
SCAN = np.array([[3.0, 0.0], [0.0, 2.0]], np.float32)


def followed(second: int, poses: Sequence[Sequence[float]], claimed: bool) -> HypothesesFollowed:
    return HypothesesFollowed(second * SECOND_NS, np.array(poses), np.zeros(len(poses)), claimed, SCAN)


def published(second: int) -> PosePublished:
    return PosePublished(second * SECOND_NS, Pose2(1.0, 2.0), Pose2(), Pose2(1.0, 2.0), np.eye(3), State.TRACKING)


def strips(rrd: Path, entity: str) -> list[int]:
    """How many strips each log of `entity` has, in their order."""
    counts: list[int] = []
    for chunk in RrdReader(rrd).stream().filter(content=entity).to_chunks():
        column: dict[str, Any] = chunk.to_record_batch().to_pydict()
        logged = next((values for name, values in column.items() if name.endswith("LineStrips2D:strips")), [])
        counts += [] if chunk.is_static else [len(value) for value in logged if value is not None]
    return counts


def test_the_robot_is_shown_only_while_its_pose_is_known(tmp_path: Path) -> None:
    log = RerunLog(RerunConfig(), rrd := tmp_path / "session.rrd")
    log.log(StateChanged(0, State.RELOCALISING, "no place yet"))
    log.log(StateChanged(2 * SECOND_NS, State.TRACKING, "found"))
    log.log(published(2))
    log.log(StateChanged(5 * SECOND_NS, State.LOST, "taken elsewhere"))
    log.log(StateChanged(8 * SECOND_NS, State.TRACKING, "found again"))
    log.log(published(8))
    log.close()
    assert strips(rrd, "/map/robot/arrow") == [0, 1, 0, 1]
    assert strips(rrd, "/map/ellipse/outline") == [0, 1, 0, 1]


def test_the_claimed_hypothesis_is_the_robot_and_not_one_of_them(tmp_path: Path) -> None:
    log = RerunLog(RerunConfig(), rrd := tmp_path / "session.rrd")
    log.log(followed(0, [], claimed=False))
    log.log(followed(1, TWO_PLACES.tolist(), claimed=False))
    log.log(followed(2, TWO_PLACES.tolist(), claimed=True))
    log.log(followed(3, TWO_PLACES[:1].tolist(), claimed=True))
    log.close()
    assert strips(rrd, "/map/hypotheses") == [0, 2, 1, 0]
