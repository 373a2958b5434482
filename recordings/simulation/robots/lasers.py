"""The laser of a robot: the world's laser, with the flaws of a real one or as a coarse one."""

import math
from dataclasses import replace

import numpy as np

from wayfi.recordings.simulation.laser import LaserSpec
from wayfi.recordings.simulation.robots.models import LaserRanges

COARSE_INCREMENT_RAD = math.radians(1.0)
COARSE_RESOLUTION_M = 0.01
COARSE_HZ = (2.0, 7.0)
COARSE_TURN_S = 0.1  # the motion during a sweep is a straight line: true enough within a tenth of a second
COARSE_RANGE_M, COARSE_REACH_M = 12.0, 24.0
MILLISECOND_NS = 1_000_000


def draw_laser(spec: LaserSpec, ranges: LaserRanges, rng: np.random.Generator) -> LaserSpec:
    """`spec` with flaws drawn from `ranges`."""
    divergence_rad, mixed_share = rng.uniform(*ranges.divergence_rad), rng.uniform(*ranges.mixed_share)
    flawed = replace(spec, divergence_rad=divergence_rad, mixed_share=mixed_share)
    return _coarse(flawed, rng) if ranges.coarse else flawed


def _coarse(spec: LaserSpec, rng: np.random.Generator) -> LaserSpec:
    """The laser with one beam a degree over the same view, 1 cm of resolution, a shorter range and a lower rate."""
    view = (spec.beams - 1) * spec.angle_increment
    period_ns = round(1000 / rng.uniform(*COARSE_HZ)) * MILLISECOND_NS
    return replace(
        spec,
        beams=round(view / COARSE_INCREMENT_RAD) + 1,
        angle_increment=COARSE_INCREMENT_RAD,
        range_max_m=min(spec.range_max_m, COARSE_RANGE_M),
        reach_m=min(spec.reach_m, COARSE_REACH_M),
        period_ns=max(period_ns, spec.period_ns),
        turn_s=COARSE_TURN_S,
        resolution_m=COARSE_RESOLUTION_M,
    )
