"""The best hypotheses that are one place: along walls that leave the place open there are several of one heading."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from wayfi.backend.graph.health import position_sigma
from wayfi.backend.pose2 import Floats, Pose2, wrap
from wayfi.frontends.localization.hypotheses import Hypothesis
from wayfi.frontends.localization.local_track import LocalTrack
from wayfi.frontends.localization.localization_config import ClaimConfig
from wayfi.frontends.localization.wifi_support import WifiSupport

LAG = 1  # keyframes behind the newest: the scans of all hypotheses are compared over the next messages


@dataclass(frozen=True, slots=True, eq=False)
class Cluster:
    """The `best` hypothesis, and the mean `T_map_base` and (3, 3) covariance of those that are the same place.

    They are those of the local `keyframe`. `gain` (nats) is their evidence over that of all others, of which `rivals`
    come within the gain that confirms; `proposed` searches found it. On `twin_floors` the last scans fit about as well.
    """

    best: Hypothesis
    keyframe: int
    T_map_base: Pose2
    covariance: Floats
    gain: float
    rivals: int
    proposed: int
    twin_floors: tuple[int, ...] = ()

    def is_sharp(self, config: ClaimConfig, slack: float = 1.0) -> bool:
        """Whether the pose is known as well as scans tell; `slack` multiplies the bounds."""
        sigma_rad = math.sqrt(self.covariance[2, 2])
        return position_sigma(self.covariance) <= slack * config.sharp_m and sigma_rad <= slack * config.sharp_rad


def score(hypothesis: Hypothesis, wifi: WifiSupport) -> float:
    """The evidence (nats) of laser and WiFi for a hypothesis, to compare with that for others."""
    return hypothesis.evidence + wifi.nats(hypothesis.T_map_base, hypothesis.floor)


def evidence_before(
    newcomer: Hypothesis, hypotheses: Iterable[Hypothesis], track: LocalTrack, config: ClaimConfig
) -> float:
    """The evidence (nats) that a newcomer has up to its keyframe: that of the nearest which is one place with it there.

    Where none is, its way is taken to have fitted as well as that of any other.
    """
    keyframe, T = newcomer.keyframe, newcomer.T_map_base
    near, known = [], []
    for h in hypotheses:
        evidence = h.evidence_at(keyframe)
        if evidence is None:
            continue
        known.append(evidence)
        if h.keyframe >= track.first:
            there = h.T_map_base @ track.between(h.keyframe, keyframe)
            if _near([there, T], [h.floor, newcomer.floor], 1, [0], config):
                near.append((there.distance(T), evidence))
    return min(near)[1] if near else max(known, default=0.0)


def cluster_of(
    hypotheses: Sequence[Hypothesis],
    track: LocalTrack,
    wifi: WifiSupport,
    config: ClaimConfig,
    best: Hypothesis | None = None,
) -> Cluster | None:
    """The cluster around the best of the hypotheses, or of those around a given one, at the track's newest keyframe.

    None if no hypothesis has been tried up to there.
    Those that have yet to be tried on the way here are rivals with the evidence that they have, which only falls.
    """
    tried = [k for k, h in enumerate(hypotheses) if h.keyframe >= track.newest - LAG or h is best]
    if not tried:
        return None
    here = [h.T_map_base @ track.between(h.keyframe, track.newest) for h in hypotheses]
    scores = np.array([h.evidence + wifi.nats(T, h.floor) for h, T in zip(hypotheses, here, strict=True)])
    floors = [h.floor for h in hypotheses]
    around = tried if best is None else _near(here, floors, hypotheses.index(best), tried, config)
    k = max(around, key=lambda i: scores[i])
    near = _near(here, floors, k, range(len(here)), config)
    inside = [i for i in near if i in tried or not hypotheses[i].is_new]
    outside = np.delete(scores, near)
    total = float(np.logaddexp.reduce(scores[inside]))
    weights = np.exp(scores[inside] - total)
    errors = np.array([here[k].error_of(here[i]) for i in inside])
    mean = weights @ errors
    covariance = (errors - mean).T @ (weights[:, None] * (errors - mean))
    covariance += np.einsum("n,nij->ij", weights, np.array([hypotheses[i].covariance for i in inside]))
    gain = total - float(np.logaddexp.reduce(outside)) if len(outside) else math.inf
    rivals = int((scores[k] - outside < config.min_gain).sum())
    proposed = max(hypotheses[i].proposed for i in inside)
    twins = _twin_floors(hypotheses, hypotheses[k], config)
    return Cluster(
        hypotheses[k], track.newest, Pose2.of(here[k].array() + mean), covariance, gain, rivals, proposed, twins
    )


def _near(
    poses: Sequence[Pose2], floors: Sequence[int], best: int, numbers: Iterable[int], config: ClaimConfig
) -> list[int]:
    """Those of the `numbers` whose poses are one place with the best one."""
    at = poses[best]
    return [
        k
        for k in numbers
        if floors[k] == floors[best]
        and (T := poses[k]).distance(at) < config.cluster_m
        and abs(wrap(T.theta - at.theta)) < config.cluster_rad
    ]


def _twin_floors(hypotheses: Sequence[Hypothesis], best: Hypothesis, config: ClaimConfig) -> tuple[int, ...]:
    """The other floors with a place that as many scans in a row agree with, about as well."""
    return tuple(sorted({h.floor for h in hypotheses if h.floor != best.floor and is_twin(h, best, config)}))


def is_twin(hypothesis: Hypothesis, best: Hypothesis, config: ClaimConfig) -> bool:
    """Whether the last scans fit the place of a hypothesis about as well as that of the best one."""
    return hypothesis.agreed >= config.fixes and hypothesis.quality >= best.quality - config.twin_quality
