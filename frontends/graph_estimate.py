"""The pose graph's estimate as last updated, cached: iSAM2 is read only for what has changed."""

from collections.abc import Callable
from typing import Any

import numpy as np

from wayfi.backend.graph.backend_config import BackendConfig
from wayfi.backend.graph.health import Health, State, judge_health, worse
from wayfi.backend.graph.pose_graph import PoseGraph
from wayfi.backend.pose2 import Floats, Pose2
from wayfi.frontends.events import CalibrationUpdated, Event, GraphUpdated, StateChanged
from wayfi.frontends.keyframes import Keyframes
from wayfi.frontends.odometry.live_pose import ORIGIN_COVARIANCE
from wayfi.frontends.timer import Timer

CALIBRATION_EVERY = 20  # keyframes between two events: they are drawn alone, and the sigmas cost a marginal each
SETTLING_REVIEWS = 3  # at the end: removing a closure may change the verdict on others, rarely three times in a row
RECENT_KEYFRAMES = 3  # read after a keyframe without a closure: its factors hardly move those further back


class GraphEstimate:
    """Poses of the keyframes, the wheels' calibration (4,), the newest pose's covariance (3, 3), and its health.

    `moved`: poses of earlier keyframes have changed with the last update.
    """

    def __init__(
        self, graph: PoseGraph, keyframes: Keyframes, calibration: Floats, config: BackendConfig, timer: Timer
    ) -> None:
        self._graph, self._keyframes, self._config, self._timer = graph, keyframes, config, timer
        self._poses: Floats = np.zeros((64, 3))
        self.calibration = calibration
        self.covariance: Floats = ORIGIN_COVARIANCE
        self._health: Health | None = None
        self.moved = False

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Restore from a checkpoint; the poses are read again, since the graph restarts from its estimate."""
        vars(self).update(state)
        self.poses[:] = self._graph.poses()[: len(self._keyframes)]

    def reread(self) -> None:
        """Read the poses of keyframes that were added without guesses."""
        self._poses = np.resize(self._poses, (len(self._keyframes) + len(self._poses), 3))
        self.poses[:] = self._graph.poses()[: len(self._keyframes)]

    @property
    def poses(self) -> Floats:
        """(n, 3) poses of all keyframes in `map`; a view, which later updates change."""
        return self._poses[: len(self._keyframes)]

    @property
    def state(self) -> State:
        """TRACKING, UNCERTAIN or LOST, as last observed."""
        return self._health.state if self._health else State.TRACKING

    def append(self, guess: Pose2) -> None:
        """Give the newest keyframe its first guess as pose."""
        if len(self._keyframes) > len(self._poses):
            self._poses = np.resize(self._poses, (2 * len(self._poses), 3))
        self.poses[-1] = guess.array()

    def update(self, stamp_ns: int, moved: bool = False) -> list[Event]:
        """Update the graph and read the estimate; `moved`: poses of earlier keyframes have changed before."""
        with self._timer("backend"):
            summary = self._graph.update()
            self.moved = moved or summary.moved
            if self.moved:
                self.poses[:] = self._graph.poses()
            else:
                self._refresh_recent()
            self.calibration = self._graph.calibration_values()
        number = len(self._keyframes) - 1
        poses = self.poses.copy() if self.moved else None
        residual_m = self._step_residual_m()
        return [GraphUpdated(stamp_ns, number, poses, summary.added, summary.removed, summary.factors, residual_m)]

    def settle(self, stamp_ns: int, review: Callable[[], list[Event]]) -> list[Event]:
        """Let the graph settle at a drive's end, and `review` the closures by it, until that changes nothing more."""
        events: list[Event] = []
        for _ in range(SETTLING_REVIEWS):
            events += self._settled(stamp_ns)
            if not (reviewed := review()):
                break
            events += reviewed
        return events + self._settled(stamp_ns)

    def solve_anew(self, stamp_ns: int) -> list[Event]:
        """Optimise the whole graph from the estimate, and read that."""
        if not self._graph.restarts:
            self._graph.restart(self._graph.calibrations(), self._graph.poses())
        return self._settled(stamp_ns)

    def observe(self, stamp_ns: int, variance_factor: float = 1.0, doubt: Health | None = None) -> list[Event]:
        """Read the newest pose's covariance; returns a change of health (see `judge`), now and then the calibration.

        The graph's covariance is multiplied by `variance_factor`, unless the robot is in doubt.
        """
        events: list[Event] = []
        number = len(self._keyframes) - 1
        with self._timer("backend"):
            self.covariance = self._graph.covariance(number) * (1.0 if doubt else variance_factor)
            if number % CALIBRATION_EVERY == 0:
                calibration = self._graph.calibration()
                events.append(CalibrationUpdated(stamp_ns, calibration.values, calibration.sigmas))
        return events + self.judge(stamp_ns, doubt)

    def judge(self, stamp_ns: int, doubt: Health | None) -> list[Event]:
        """Update the health: the worse one of the covariance's, as last read, and `doubt`; returns its change."""
        health = worse(doubt, judge_health(self.covariance, self._config.uncertain_sigma_m, self._config.lost_sigma_m))
        changed = self._health is None or health.state is not self._health.state
        self._health = health
        return [StateChanged(stamp_ns, health.state, health.reason, health.failure_category)] if changed else []

    def _settled(self, stamp_ns: int) -> list[Event]:
        self._graph.settle()
        return self.update(stamp_ns, moved=True)

    def _refresh_recent(self) -> None:
        n = len(self._keyframes)
        for k in range(max(0, n - RECENT_KEYFRAMES), n):
            self._poses[k] = self._graph.pose(k).array()

    def _step_residual_m(self) -> float:
        """Distance (m) between the end of the newest step as estimated and by the calibrated wheels."""
        if len(self._keyframes) < 2:
            return 0.0
        before, newest = self._keyframes[len(self._keyframes) - 2], self._keyframes.newest
        expected = before.point.motion_to(newest.point).corrected(self.calibration)
        step = Pose2.of(self.poses[-2]).between(Pose2.of(self.poses[-1]))
        return step.distance(expected)
