"""Headings along the axes of the building enter the graph where no scan match tells the heading."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from wayfi.backend.graph.factors import AxisFactor, BetweenFactor, NearFactor, WallFactor, WheelFactor
from wayfi.backend.graph.pose_graph import PoseGraph
from wayfi.backend.graph.wheel_calibration import WheelCalibration, WheelMotion, chain, corrected_all
from wayfi.backend.pose2 import Floats, wrap_all
from wayfi.frontends.axes.building_axes import AlongAxis, BuildingAxes
from wayfi.frontends.axes.wall_direction import quarter
from wayfi.frontends.odometry.odometry_config import AxesConfig

ONE_DIRECTION_RAD = 0.1  # between axes: wheels turn by more in a wing; walls at so small an angle are rare


class AxisHeadings:
    """Follows the wheels from keyframe to keyframe, and adds a factor for each sample along an axis.

    Wings are numbered on from those that the graph holds: they are of a map, in which the drive is not placed yet.
    """

    def __init__(self, graph: PoseGraph, prior: WheelCalibration, config: AxesConfig) -> None:
        self._graph, self._prior, self._config = graph, prior, config
        self._axes: BuildingAxes | None = None
        self._start = 0
        self._doubted: set[int] = set()
        self._numbers: dict[int, int] = {}  # in the graph, of the wings that were driven along

    def interrupt(self) -> None:
        """A scan match tells the heading: what the wheels alone tell begins anew after it."""
        self._axes = None
        self._numbers = {}

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
        if settled and self._numbers and not _driven(self._graph):
            self.interrupt()  # they were withdrawn
            return
        self._add(settled, self._start)
        if self._bends(settled, poses):
            self._restart(self._axes.calibration, poses)

    def decide_again(self) -> bool:
        """At the end, decide by what is known of the wheels now what was driven along axes; returns whether that helps.

        It does where axes were withdrawn, or where the wheels' errors passed for another wing at first. Nothing changes
        where scans were matched, where the drive goes on with a map, or unless more samples are along axes than before,
        or the wings are fewer.
        """
        graph, wheels = self._graph, self._graph.of_kind(WheelFactor)
        if not (self._config.enabled and self._tell_all()):
            return False
        known = WheelCalibration(graph.calibrations()[0], graph.calibration().sigmas)
        axes = BuildingAxes(graph.pose(0).theta, known, self._config)
        settled: list[AlongAxis] = []
        for factor in wheels:
            axes.add(factor.motion, float(factor.covariance[2, 2]))
            settled += axes.settled()
        before = list(_driven(graph).values())
        samples, wings = len(settled) - len(before), len({s.wing for s in settled}) - len({f.wing for f in before})
        if samples < 0 or (before and wings > 0) or samples == wings == 0:
            return False
        withdraw_axes(graph)
        self._numbers = {}
        self._add(settled, 0)
        graph.restart(graph.calibrations(), graph.poses())
        return True

    def join_wings(self) -> bool:
        """At the end, let wings whose axes have one direction be one, as when the robot came back to the first of them.

        Returns whether any were joined. The wheels' error in between, and not the building's, then turned the later.
        """
        if not self._tell_all():
            return False
        axes = _driven(self._graph)
        headings, directions = self._graph.poses()[:, 2], dict[int, float]()
        wings = sorted({factor.wing for factor in axes.values()})
        for wing in wings:
            own = {n: f for n, f in axes.items() if f.wing == wing}
            direction = float(np.angle(sum(np.exp(1j * (headings[f.b] - f.turned)) for f in own.values())))
            if (same := _same_wing(direction, directions)) is None:
                directions[wing] = direction
                continue
            for number, factor in own.items():
                self._graph.remove(number)
                self._graph.add(replace(factor, wing=same[0], turned=factor.turned + same[1]))
        joined = len(directions) < len(wings)
        if joined:
            self._graph.restart(self._graph.calibrations(), self._graph.poses())
        return joined

    def _tell_all(self) -> bool:
        """Whether the wheels alone tell all of the drive, and it goes on with no map."""
        wheels = len(self._graph.of_kind(WheelFactor))
        return 0 < wheels == self._graph.keyframes - 1 and not self._graph.scan_matched().any()

    def _add(self, settled: list[AlongAxis], start: int) -> None:
        """Add a factor for each sample, whose steps count from keyframe `start`."""
        for along in settled:
            wing = self._numbers.setdefault(along.wing, self._graph.newest_wing + 1)
            keyframe = start + along.step
            self._graph.add(AxisFactor(keyframe, wing, along.turned, self._config.sigma_rad))
            if along.slipped:
                self._doubt_wheels(start + along.doubtful_from, keyframe, along.slipped**2)

    def _doubt_wheels(self, first: int, last: int, variance: float) -> None:
        """Give the wheels' turns between two keyframes `variance` (rad^2) more, once: they slipped at one of them."""
        doubtful = set(range(first + 1, last + 1)) - self._doubted
        self._doubted |= doubtful
        steps = {n: f for n, f in self._graph.factors().items() if isinstance(f, WheelFactor) and f.b in doubtful}
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
        """Start the graph from the wheels with this turn scale and bias (rad/m), from `poses` if more is known of them.

        More is known where loops are closed, where scans were matched, and in a map.
        """
        graph = self._graph
        closed = any(isinstance(factor, NearFactor | BetweenFactor) for factor in graph.factors().values())
        if closed or not self._tell_all():
            graph.restart(graph.calibrations(), poses)
            return
        values = graph.calibration_values().copy()
        values[1:3] = turning
        motions = [factor.motion for factor in graph.of_kind(WheelFactor)]
        rows = np.array([(*motion.pose.array(), motion.path_m, motion.seconds) for motion in motions])
        graph.restart(values, chain(corrected_all(rows, values)))


def _same_wing(direction: float, directions: Mapping[int, float]) -> tuple[int, float] | None:
    """The wing whose axes' direction of `directions` (rad) a `direction` is, and the quarter turns (rad) in between."""
    off = {wing: quarter(direction - other) for wing, other in directions.items()}
    wing = min(off, key=lambda wing: abs(off[wing]), default=None)
    if wing is None or abs(off[wing]) > ONE_DIRECTION_RAD:
        return None
    return wing, direction - directions[wing] - off[wing]


def withdraw_axes(graph: PoseGraph) -> None:
    """Remove what the axes told from the graph; what follows begins anew, with what is known of the wheels then."""
    for number in _driven(graph):
        graph.remove(number)


def _driven(graph: PoseGraph) -> dict[int, AxisFactor]:
    """The factors of headings along which the robot drove, not of walls that it saw, by their numbers."""
    axes = {n: f for n, f in graph.factors().items() if isinstance(f, AxisFactor)}
    return {n: f for n, f in axes.items() if not isinstance(f, WallFactor)}
