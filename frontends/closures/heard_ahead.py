"""How far ahead of the robot its WiFi hears, learnt at a drive's end from places that were passed in both directions.

A robot that shades its receiver from behind hears each place as one further ahead; a scan that is stamped late, as one
further behind. Passes in one direction agree all the same, but those in opposite directions do not: their claims pull
every turn at the end of an aisle longer or shorter, and the map with it.

The distance is one unknown of all claims. As a state of the graph it would make each update visit every claim; here the
graph is solved for two distances, and as its cost is a parabola in them, their slopes tell the one where it is least.
"""

import math
from dataclasses import replace

import numpy as np

from wayfi.backend.graph.factors import NearFactor
from wayfi.backend.graph.pose_graph import PoseGraph
from wayfi.frontends.closures.wifi_claims import Claim, WifiClaims

PRIOR_M = 0.5  # sigma of the distance: a phone's second of delay on a slow robot; shading was seen to make 0.3 to 0.7
MOST_M = 3 * PRIOR_M  # where the slope hardly changes, its line leads anywhere


def learn_heard_ahead(graph: PoseGraph, claims: WifiClaims) -> bool:
    """Learn the distance, for which the graph settles, and give it to the accepted claims' factors.

    Returns whether these have changed: not where they say less of the distance than is known before.
    """
    slope, curvature = _slope(graph, claims)
    if curvature < 2 / PRIOR_M**2:
        return False
    first_m = claims.ahead_m
    probed_m = first_m - math.copysign(PRIOR_M, slope)
    _hear(graph, claims, probed_m)
    graph.settle()
    probed_slope, _ = _slope(graph, claims)
    least_m = first_m + (probed_m - first_m) * slope / (slope - probed_slope) if slope != probed_slope else first_m
    _hear(graph, claims, min(max(least_m, -MOST_M), MOST_M))
    return True


def _slope(graph: PoseGraph, claims: WifiClaims) -> tuple[float, float]:
    """The slope of the settled graph's cost by the distance, and the curvature that it had if the poses stayed."""
    accepted = _accepted(claims)
    if not accepted:
        return 0.0, 0.0
    factors, poses, pairs = graph.factors(), graph.poses(), claims.pairs(accepted)
    weight = np.array([_near(factors[n]).sigma_m ** -2 for n in (c.factor for c in accepted) if n is not None])
    heading_a, heading_b = (
        poses[k, 2] + [f.T_keyframe_base.theta for f in fingerprints]
        for k, fingerprints in (
            (pairs.a, [c.candidate.a for c in accepted]),
            (pairs.b, [c.candidate.b for c in accepted]),
        )
    )
    moved = np.column_stack([np.cos(heading_b) - np.cos(heading_a), np.sin(heading_b) - np.sin(heading_a)])
    slope = weight @ (pairs.apart(poses) * moved).sum(axis=1) + claims.ahead_m / PRIOR_M**2
    return float(slope), float(weight @ (moved**2).sum(axis=1) + PRIOR_M**-2)


def _hear(graph: PoseGraph, claims: WifiClaims, ahead_m: float) -> None:
    """Let the places of all claims be `ahead_m` ahead of where the robot was, and start the graph again with them.

    Taken in one update, so many other factors leave iSAM2's tree so deep that a covariance may never come.
    """
    claims.ahead_m = ahead_m
    factors = graph.factors()
    for claim in _accepted(claims):
        assert claim.factor is not None
        a, b = claims.places(claim.candidate)
        graph.substitute(claim.factor, replace(_near(factors[claim.factor]), place_a=a, place_b=b))
    graph.restart(graph.calibrations(), graph.poses())


def _accepted(claims: WifiClaims) -> list[Claim]:
    return [claim for claim in claims.all() if claim.factor is not None]


def _near(factor: object) -> NearFactor:
    assert isinstance(factor, NearFactor)
    return factor
