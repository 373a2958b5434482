"""What a daemon's run published, and what it left in its folder."""

import json
import math
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from live.daemons import Running, message_of

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.measurements import SECOND_NS, Odometry, Sensor
from wayfi.recordings.files.tum import read_tum
from wayfi.recordings.mcap.blocks import RecordingError
from wayfi.recordings.mcap.recording import open_recording
from wayfi.recordings.ros.codec import decode
from wayfi.recordings.ros.messages import POSE_WITH_COVARIANCE
from wayfi.recordings.ros.ros_messages import Message
from wayfi.recordings.ros.topics import CONTROL_TOPIC, Encoding
from wayfi.recordings.trajectory import Trajectory
from wayfi.service.drive.counters import merged
from wayfi.service.evaluation.trajectory_scores import absolute_error
from wayfi.service.replay.replay import ReplayOptions, replay, settings_for
from wayfi.service.transport.message_queue import QueueDrop

MS_NS = 1_000_000


def odometry_of(recording: Path) -> list[Odometry]:
    messages = [decode(r.data, Sensor.ODOM, Encoding.CDR) for r in open_recording(recording) if r.topic == "/odom"]
    return [m for m in messages if isinstance(m, Odometry)]


def poses_of(daemon: Running) -> list[Message]:
    return [message_of(data, POSE_WITH_COVARIANCE) for data in daemon.samples["wayfi/pose"]]


def stamp_ns(header: Message) -> int:
    return int(header.stamp.sec) * SECOND_NS + int(header.stamp.nanosec)


def pose_of(message: Message) -> Pose2:
    p, q = message.pose.pose.position, message.pose.pose.orientation
    return Pose2(p.x, p.y, 2 * math.atan2(q.z, q.w))


def recorded(daemon: Running) -> int:
    """How many messages of sensors the black box holds: what a kill leaves."""
    with suppress(RecordingError):  # there is nothing in it yet
        return sum(record.topic != CONTROL_TOPIC for record in open_recording(daemon.folder))
    return 0


def report_of(folder: Path) -> dict[str, Any]:
    report: dict[str, Any] = json.loads((folder / "report.json").read_text())
    return report


def replays_alike(folder: Path, out: Path) -> bool:
    """Whether the black box gives the trajectories that the daemon left, to the byte."""
    config, calibration = settings_for(folder, (), (), None)
    replay(folder, config, calibration, ReplayOptions(out, rrd=False))
    return all((out / n).read_bytes() == (folder / n).read_bytes() for n in ("trajectory.tum", "online.tum"))


def error_m(folder: Path, truth: Trajectory) -> float:
    """ATE RMSE, m, at the stamps of the trajectory."""
    estimate = read_tum(folder / "trajectory.tum")
    at = np.isin(truth.stamps_ns // MS_NS, estimate.stamps_ns // MS_NS)
    assert at.any()
    return absolute_error(estimate, Trajectory(truth.stamps_ns[at], truth.poses[at])).error.ate_rmse_m


def assert_nothing_vanished(daemon: Running, recording: Path) -> None:
    """Every message was fed, or is counted as one that the queues dropped."""
    report = report_of(daemon.folder)
    unfed = {t: sum(n for why, n in whys.items() if why in set(QueueDrop)) for t, whys in report["dropped"].items()}
    assert merged({"": report["messages"]}, {"": unfed})[""] == open_recording(recording).message_counts


def assert_every_pose(daemon: Running, overtaken: int = 0, restamped: int = 0) -> None:
    """Every odometry message that was not dropped for a reason gave a pose, but for so many that came too late.

    `restamped` may have been published under another stamp, before the estimation reported a jump of the clock.
    """
    used = report_of(daemon.folder)["messages"]["/odom"] - sum(drops(daemon, "/odom").values())
    kept = len(read_tum(daemon.folder / "online.tum").poses)
    assert used <= kept
    assert kept - overtaken <= len(poses_of(daemon)) <= kept + restamped


def drops(daemon: Running, topic: str) -> dict[str, int]:
    """How many messages were dropped, by reason."""
    reasons: dict[str, int] = report_of(daemon.folder)["dropped"].get(topic, {})
    return reasons
