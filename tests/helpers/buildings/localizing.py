"""Drives through buildings localised in a saved map, in this process, and what was said of it."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from drives import Simulated, write

from wayfi.backend.pose2 import Pose2, compose_all
from wayfi.recordings.files.tum import read_tum
from wayfi.recordings.trajectory import Trajectory
from wayfi.service.config import load_config
from wayfi.service.evaluation.trajectory_scores import absolute_error
from wayfi.service.replay.localize import localize
from wayfi.service.replay.replay import ReplayOptions, replay


@dataclass(frozen=True)
class Mapped:
    """A folder of results with a map in it, and where the map's frame is in that of the truth."""

    out: Path
    T_truth_map: Pose2


@dataclass(frozen=True)
class Localised:
    """The report of a localisation, and the distance (m) of each claimed pose from the truth."""

    report: dict[str, Any]
    errors_m: "np.typing.NDArray[np.float64]"

    @property
    def states(self) -> list[str]:
        """The states in their order."""
        return [change["state"] for change in self.report["status_changes"]]

    @property
    def reasons(self) -> str:
        """The reasons of all states, a line each."""
        return "\n".join(change["reason"] for change in self.report["status_changes"])

    @property
    def categories(self) -> set[str]:
        """All failure categories that there were."""
        return {change["failure_category"] for change in self.report["status_changes"]}


def map_of(driven: Simulated, folder: Path) -> Mapped:
    """Replay a drive; the map that it leaves."""
    recording = write(folder / "mapped.mcap", driven.arrivals)
    replay(recording, load_config((), ()), None, ReplayOptions(folder / "mapped", rrd=False))
    fitted = absolute_error(read_tum(folder / "mapped" / "trajectory.tum"), driven.truth)
    return Mapped(folder / "mapped", fitted.T_reference_estimate)


def localised(mapped: Mapped, driven: Simulated, folder: Path, *settings: str) -> Localised:
    """Localise a drive in a map."""
    recording, out = write(folder / "driven.mcap", driven.arrivals), folder / "localised"
    report = localize(recording, mapped.out, load_config((), settings), None, ReplayOptions(out, rrd=False))
    return Localised(report, errors_m(out / "online.tum", mapped.T_truth_map, driven.truth))


def errors_m(tum: Path, T_truth_map: Pose2, truth: Trajectory) -> "np.typing.NDArray[np.float64]":
    """(n,) distances of a trajectory in the map's frame from the truth, without any alignment."""
    claimed = read_tum(tum, may_be_empty=True)
    if not len(claimed):
        return np.zeros(0)
    placed = compose_all(T_truth_map.array(), claimed.poses)
    return np.asarray(np.hypot(*(placed - truth.at(claimed.stamps_ns))[:, :2].T))
