"""Headings along the axes of the building enter the graph where no scan match tells the heading."""

from dataclasses import replace

import numpy as np

from wayfi.backend.graph.factors import AxisFactor, NearFactor, WheelFactor
from wayfi.backend.graph.pose_graph import PoseGraph
from wayfi.backend.graph.wheel_calibration import WheelCalibration, WheelMotion, chain, corrected_all
from wayfi.backend.pose2 import Floats, wrap_all
from wayfi.frontends.odometry.building_axes import AlongAxis, BuildingAxes
from wayfi.frontends.odometry.odometry_config import AxesConfig


class AxisHeadings:
    """Follows the wheels from keyframe to keyframe, and adds a factor for each sample along an axis.

    Wings are numbered on from those that the graph holds: they are of a map, in which the drive is not placed yet.
    """

    def __init__(self, graph: PoseGraph, prior: WheelCalibration, config: AxesConfig) -> None:
        self._graph, self._prior, self._config = graph, prior, config
        self._axes: BuildingAxes | None = None
        self._start = 0
        self._wings = self._newest_wing = max((factor.wing for factor in graph.of_kind(AxisFactor)), default=0)

    def interrupt(self) -> None:
        """A scan match tells the heading: what the wheels alone tell begins anew after it."""
        self._axes = None
        self._wings = self._newest_wing

    def follow(self, number: int, motion: WheelMotion, variance: float, poses: Floats) -> None:
        """Keyframe `number` was reached by `motion`, whose turn errs at random by `variance` (rad^2).

        `poses` (n, 3) are those of the keyframes before it.
        """
        if not self._config.enabled:
            return
        if self._axes is None:
            if self._graph.restarts:
                return  # the wheels' calibration is about to be another
            known = self._graph.calibration() if number > 1 else self._prior
            self._axes, self._start = BuildingAxes(float(poses[-1, 2]), known, self._config), number - 1
        self._axes.add(motion, variance)
        settled = self._axes.settled()
        if settled and self._newest_wing > self._wings and not self._graph.of_kind(AxisFactor):
            self.interrupt()  # they were withdrawn
            return
        for along in settled:
            self._newest_wing = self._wings + along.wing
            keyframe = self._start + along.step
            self._graph.add(AxisFactor(keyframe, self._newest_wing, along.turned, self._config.sigma_rad))
            if along.slipped:
                self._doubt_wheels(self._start + along.doubtful_from, keyframe, along.slipped**2)
        if self._bends(settled, poses):
            self._restart(self._axes.calibration, poses)

    def _doubt_wheels(self, first: int, last: int, variance: float) -> None:
        """Give the wheels' turns between two keyframes `variance` (rad^2) more: they slipped at one of the steps."""
        steps = {n: f for n, f in self._graph.factors().items() if isinstance(f, WheelFactor) and first < f.b <= last}
        for number, factor in steps.items():
            covariance = factor.covariance + np.diag([0.0, 0.0, variance / len(steps)])
            self._graph.substitute(number, replace(factor, covariance=covariance))

    def _bends(self, settled: list[AlongAxis], poses: Floats) -> bool:
        """Whether these samples bend the path by so much that Gauss-Newton steps may diverge."""
        if len(settled) < 2 or self._graph.restarts:
            return False
        headings = poses[[self._start + along.step for along in settled], 2]
        off = wrap_all(headings - np.array([along.turned for along in settled]))
        return bool(np.abs(wrap_all(off - off[0])).max() > self._config.leap_rad)

    def _restart(self, turning: tuple[float, float], poses: Floats) -> None:
        """Start the graph from the wheels with this turn scale and bias (rad/m); from `poses` if loops are closed."""
        if any(isinstance(factor, NearFactor) for factor in self._graph.factors().values()):
            self._graph.restart(self._graph.calibrations(), poses)
            return
        values = self._graph.calibration_values().copy()
        values[1:3] = turning
        motions = [factor.motion for factor in self._graph.of_kind(WheelFactor)]
        rows = np.array([(*motion.pose.array(), motion.path_m, motion.seconds) for motion in motions])
        self._graph.restart(values, chain(corrected_all(rows, values)))


def withdraw_axes(graph: PoseGraph) -> None:
    """Remove what the axes told from the graph; what follows begins anew, with what is known of the wheels then."""
    for number, factor in graph.factors().items():
        if isinstance(factor, AxisFactor):
            graph.remove(number)
