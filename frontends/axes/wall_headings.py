"""The walls that scans see tell the heading: most of a building's walls stand along its axes.

Walls as a compass are an old idea (Weiss, Wetzler and von Puttkamer, IROS 1994). Where no loop is closed they alone
hold the heading, for each scan match adds its error to those before.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from wayfi.backend.graph.factors import WallFactor
from wayfi.backend.graph.pose_graph import PoseGraph
from wayfi.backend.pose2 import Floats, wrap
from wayfi.frontends.axes.wall_direction import QUARTER, quarter, wall_direction
from wayfi.frontends.axes.walls_config import WallsConfig
from wayfi.frontends.keyframes import Keyframes

_SPREAD_RAD = 0.02  # of the scans of a sample: of those with more the robot turned, or they saw two wings
_SIGMAS = 3.0  # that a sample of a wing is off it at most
_REMEMBERED = 40  # samples from which the next one's sigma is learnt: 120 m
_HERE_RAD = QUARTER / 4  # further off an axis of the wing where the robot is it is not plain which one is meant
_ELSEWHERE_RAD = 0.05  # of another wing it has come back to: by chance every sixteenth is so near
_RECENT = 20  # samples that tell the direction of a wing: 60 m
_WINGS = 16  # that are known: the robot comes back to some of them


class _Seen(NamedTuple):
    """Walls stand at `angle` rad, modulo a quarter turn, in base_link at `keyframe`."""

    keyframe: int
    angle: float


class _Sample(NamedTuple):
    """At `keyframe` the robot headed `turned` rad from an axis, to `sigma_rad`; its heading had `variance` (rad^2)."""

    keyframe: int
    turned: float
    sigma_rad: float
    spread_rad2: float
    variance: float


class _Wing(NamedTuple):
    number: int
    samples: list[_Sample]


class WallHeadings:
    """Adds a factor for each sample of path along which scans see walls of a wing that is known.

    A wing begins where some samples in a row have one direction that no other has; a sample that may be of two wings is
    of none. A sample's sigma is learnt from how far those before it were off their wings. It counts among the graph's
    other factors, which claim 1 / `variance_factor` times their variance, as closures find: so its own is claimed as
    larger.
    """

    def __init__(self, graph: PoseGraph, keyframes: Keyframes, config: WallsConfig) -> None:
        self._graph, self._keyframes, self._config = graph, keyframes, config
        self.sigmas_rad: dict[int, float] = {}  # by the number of the factor
        self._offs_rad2 = [config.sigma_rad**2] * config.sigma_samples
        self._variance_factor = 1.0
        self._seen: list[_Seen] = []
        self._wings: list[_Wing] = []  # the last is where the robot is
        self._alike: list[_Sample] = []

    def follow(self, poses: Floats, variance: float, variance_factor: float) -> None:
        """The newest keyframe is at the last of `poses` (n, 3); its heading in `map` is known to `variance` (rad^2)."""
        if not self._config.enabled:
            return
        number = len(self._keyframes) - 1
        if self._keyframes.begins_piece(number):
            self._interrupt()
        self._see(number)
        path_m = self._keyframes.paths_m
        if self._seen and path_m[number] - path_m[self._seen[0].keyframe] >= self._config.sample_m:
            sample = self._sample(poses, variance)
            self._seen = []
            if sample.spread_rad2 < _SPREAD_RAD**2:
                self._variance_factor = variance_factor
                self._judge(sample, poses)

    def weigh_again(self, variance_factor: float) -> None:
        """At the end, claim all samples by the last `variance_factor`, and optimise anew.

        To take so many factors out of iSAM2 and others in would cost as much memory as all else.
        """
        factors = self._graph.factors().items()
        samples = {n: factor for n, factor in factors if isinstance(factor, WallFactor) and n in self.sigmas_rad}
        for number, factor in samples.items():
            sigma_rad = self.sigmas_rad[number] / math.sqrt(variance_factor)
            self._graph.substitute(number, replace(factor, sigma_rad=sigma_rad))
        if samples:
            self._graph.restart(self._graph.calibrations(), self._graph.poses())

    @property
    def _sigma_rad2(self) -> float:
        """The variance of a sample whose scans agree."""
        return max(float(np.mean(self._offs_rad2)), self._config.least_sigma_rad**2)

    def _interrupt(self) -> None:
        """The robot was moved: where it heads is not known from what was before."""
        self._seen, self._wings, self._alike = [], [], []

    def _see(self, number: int) -> None:
        scan = self._keyframes[number].scan
        walls = wall_direction(scan.points, scan.normals) if scan else None
        if walls and walls.share >= self._config.min_share and walls.points >= self._config.min_points:
            self._seen.append(_Seen(number, walls.angle))

    def _sample(self, poses: Floats, variance: float) -> _Sample:
        """What the scans since the last sample say of the heading at the last of them, and their variance (rad^2)."""
        headings = poses[[seen.keyframe for seen in self._seen], 2]
        mean = np.exp(4j * (headings + [seen.angle for seen in self._seen])).mean()
        spread_rad2 = -2 * math.log(max(abs(mean), 1e-9)) / 16
        turned = wrap(float(headings[-1]) - float(np.angle(mean)) / 4)
        sigma_rad = math.sqrt(self._sigma_rad2 + spread_rad2)
        return _Sample(self._seen[-1].keyframe, turned, sigma_rad, spread_rad2, variance)

    def _judge(self, sample: _Sample, poses: Floats) -> None:
        """Let a sample be one of the wing that alone it may be of, or wait with others like it until they are plain."""
        if self._alike and self._is_near([sample], self._alike, poses, _HERE_RAD):
            self._alike = [*self._alike, sample]
        elif wings := self._wings_near([sample], poses):
            self._alike = []
            if len(wings) == 1:
                self._add_to(wings[0], [sample], poses)
        else:
            self._alike = [sample]
        if len(self._alike) >= self._config.samples_alike:
            wings = self._wings_near(self._alike, poses)
            if len(wings) <= 1:
                self._add_to(wings[0] if wings else self._new_wing(), self._alike, poses)
            self._alike = []

    def _wings_near(self, samples: Sequence[_Sample], poses: Floats) -> list[_Wing]:
        """The wings of which samples in a row may be."""
        near = [wing for wing in self._wings[:-1] if self._is_near(samples, wing.samples, poses, _ELSEWHERE_RAD)]
        return near + [wing for wing in self._wings[-1:] if self._is_near(samples, wing.samples, poses, _HERE_RAD)]

    def _is_near(self, samples: Sequence[_Sample], others: Sequence[_Sample], poses: Floats, most: float) -> bool:
        """Whether samples may be of the same walls as others before: the heading has drifted since the last of them.

        Where it may be any axis of the wing by now, as after an odometry that began anew, walls do not tell which.
        """
        drift_rad2 = max(samples[0].variance - others[-1].variance, 0.0)
        gate = _SIGMAS * math.sqrt(self._mean_rad2(samples) + self._mean_rad2(others) + drift_rad2)
        off = abs(quarter(_direction(samples, poses) - _direction(others, poses)))
        return gate < _HERE_RAD and off < min(gate, most)

    def _mean_rad2(self, samples: Sequence[_Sample]) -> float:
        """The variance of the mean of samples."""
        return min(self._config.together / len(samples), 1.0) / float(np.mean([s.sigma_rad**-2 for s in samples]))

    def _new_wing(self) -> _Wing:
        self._wings = [*self._wings, _Wing(self._graph.newest_wing + 1, [])][-_WINGS:]
        return self._wings[-1]

    def _add_to(self, wing: _Wing, samples: Sequence[_Sample], poses: Floats) -> None:
        """Samples are of a wing, which is where the robot is."""
        for sample in samples:
            self._learn(sample, wing.samples or samples, poses)
            self._add(sample, wing, poses)
        self._wings.sort(key=lambda other: other is wing)

    def _learn(self, sample: _Sample, samples: Sequence[_Sample], poses: Floats) -> None:
        """Learn the variance of samples from how far one is off others of its wing; what is far off is another wall."""
        off = quarter(_direction([sample], poses) - _direction(samples, poses))
        rad2 = max(off**2 - sample.spread_rad2, 0.0)
        self._offs_rad2 = [*self._offs_rad2, min(rad2, _SIGMAS**2 * self._sigma_rad2)][-_REMEMBERED:]

    def _add(self, sample: _Sample, wing: _Wing, poses: Floats) -> None:
        if wing.samples:
            quarters = round((_angle(sample, poses) - _angle(wing.samples[-1], poses)) / QUARTER)
            sample = sample._replace(turned=wrap(sample.turned + QUARTER * quarters))
        wing.samples.append(sample)
        del wing.samples[:-_RECENT]
        sigma_rad = math.sqrt(self._config.together) * sample.sigma_rad
        claimed = sigma_rad / math.sqrt(self._variance_factor)
        number = self._graph.add(WallFactor(sample.keyframe, wing.number, sample.turned, claimed))
        self.sigmas_rad[number] = sigma_rad


def _angle(sample: _Sample, poses: Floats) -> float:
    return float(poses[sample.keyframe, 2]) - sample.turned


def _direction(samples: Sequence[_Sample], poses: Floats) -> float:
    """The mean direction (rad) of the walls of samples, modulo a quarter turn."""
    weights = [sample.sigma_rad**-2 for sample in samples]
    return float(np.angle(weights @ np.exp([4j * _angle(sample, poses) for sample in samples]))) / 4
