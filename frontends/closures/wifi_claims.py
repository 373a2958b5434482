"""The claims of WiFi: how independent they are, and how precise they turn out.

A candidate is two similar fingerprints. A claim is a mutual candidate, which is judged: it claims that the places of
these fingerprints, a pair of places, are one. `Pairs` holds the pairs of several claims as arrays.
"""

import math
from dataclasses import dataclass

import numpy as np

from wayfi.backend.pose2 import Floats
from wayfi.frontends.closures.closure_config import ConsensusConfig
from wayfi.frontends.closures.consensus import Pairs
from wayfi.frontends.wifi.fingerprints import Fingerprint, WifiCandidate
from wayfi.frontends.wifi.wifi_config import WifiConfig

SHOWN = 40  # claims of a sequence, to bound an event: 20 m of path of one receiver


@dataclass(slots=True)
class Claim:
    """The claim that the places of a candidate are one; `number` is that of its verdict, `factor` None until accepted.

    `walls` is the factor of what the laser adds to an accepted one: the pose across the walls there, and the heading.
    `gap_m` of path lie between it and the latest earlier claim that relates the same two stretches. `confirmed`: it has
    been accepted at least once. `vetoed`: it is not judged any more.
    """

    number: int
    candidate: WifiCandidate
    gap_m: float
    factor: int | None = None
    walls: int | None = None
    confirmed: bool = False
    vetoed: bool = False


class WifiClaims:
    """The claims of a drive in the order they came. Each place is `ahead_m` ahead of where the robot was."""

    def __init__(self, config: ConsensusConfig, wifi: WifiConfig) -> None:
        self._config, self._wifi = config, wifi
        self._claims: list[Claim] = []
        self._sigma_scale = 1.0
        self.ahead_m = 0.0

    def add(self, number: int, candidate: WifiCandidate) -> Claim:
        """Add the claim of a candidate, whose verdict has this number."""
        claim = Claim(number, candidate, self._gap_m(candidate))
        self._claims.append(claim)
        return claim

    def all(self) -> list[Claim]:
        """Every claim."""
        return self._claims

    def factors(self) -> dict[int, tuple[int, ...]]:
        """The numbers of the factors of each accepted claim, by the number of its verdict."""
        held = {claim.number: (claim.factor, claim.walls) for claim in self._claims if claim.factor is not None}
        return {number: tuple(n for n in numbers if n is not None) for number, numbers in held.items()}

    def release(self, number: int) -> bool:
        """Give up the factors of an accepted claim, which was vetoed; False where it is none."""
        for claim in self._claims:
            if claim.number == number and claim.factor is not None:
                claim.factor, claim.walls, claim.vetoed = None, None, True
                return True
        return False

    def take_back(self, number: int, factors: tuple[int, ...]) -> bool:
        """Take a claim back that was restored, with its factors; False where it is none that was vetoed."""
        for claim in self._claims:
            if claim.number == number and claim.vetoed:
                claim.factor, claim.walls = factors[0], factors[1] if len(factors) > 1 else None
                claim.vetoed = False
                return True
        return False

    def recent(self) -> list[Claim]:
        """The newest claims, `window` of them at most, without those that were vetoed."""
        return [claim for claim in self._claims[-self._config.window :] if not claim.vetoed]

    def continues(self, claim: Claim) -> bool:
        """Whether a claim relates the same two stretches as an earlier one nearby."""
        return claim.gap_m < self._wifi.independent_m

    def sequence(self) -> list[Claim]:
        """The newest claims in a row, `SHOWN` of them at most, the first of which continues no other."""
        first = len(self._claims) - 1
        while self.continues(self._claims[first]):
            first -= 1
        return self._claims[first:][-SHOWN:]

    def true_share(self) -> float:
        """The share of true claims, as estimated by the accepted ones among the recent (Laplace's rule)."""
        recent = self.recent()
        return (1 + sum(claim.factor is not None for claim in recent)) / (2 + len(recent))

    def pairs(self, claims: list[Claim]) -> Pairs:
        """The pairs of places of the claims."""
        a, b = [claim.candidate.a for claim in claims], [claim.candidate.b for claim in claims]
        places = np.array([self.places(claim.candidate) for claim in claims]).reshape(-1, 2, 2)
        return Pairs(
            np.array([f.keyframe for f in a]),
            np.array([f.keyframe for f in b]),
            places[:, 0],
            places[:, 1],
            self._sigma_scale * np.array([claim.candidate.sigma_m for claim in claims]),
            np.array([later.path_m - earlier.path_m for earlier, later in zip(a, b, strict=True)]),
            np.array([min(1.0, claim.gap_m / self._wifi.neighbouring_m) for claim in claims]),
        )

    def places(self, candidate: WifiCandidate) -> tuple[Floats, Floats]:
        """(2,) m each, the places of a candidate in the frames of their keyframes."""
        return self._place(candidate.a), self._place(candidate.b)

    def _place(self, f: Fingerprint) -> Floats:
        theta = f.T_keyframe_base.theta
        return f.place + self.ahead_m * np.array([math.cos(theta), math.sin(theta)])

    def sigma_m(self, candidate: WifiCandidate) -> float:
        """The sigma of a candidate alone, m along each axis."""
        return self._sigma_scale * candidate.sigma_m

    def factor_sigma_m(self, claim: Claim) -> float:
        """The sigma of a claim in the graph: the claims within `independent_m` of path count as one together."""
        return self.sigma_m(claim.candidate) / math.sqrt(claim.gap_m / self._wifi.independent_m)

    def learn_sigma(self, recent: Pairs, poses: Floats) -> None:
        """Scale the sigmas by the distances between the places of accepted recent claims, by `poses` (n, 3).

        A scale of 1 counts as `prior_pairs` claims.
        """
        prior = self._config.prior_pairs
        accepted = np.array([claim.factor is not None for claim in self.recent()])
        sigmas = recent.apart(poses)[accepted] * (self._sigma_scale / recent.sigma_m[accepted, None])
        squared = 0.5 * float((sigmas**2).sum())
        self._sigma_scale = math.sqrt((prior + squared) / (prior + accepted.sum()))

    def _gap_m(self, candidate: WifiCandidate) -> float:
        """Path since the last claim that relates the same two stretches; `independent_m` where there is none nearer."""
        for claim in reversed(self._claims):
            gap_m = candidate.b.path_m - claim.candidate.b.path_m
            if gap_m >= self._wifi.independent_m:
                break
            if abs(candidate.a.path_m - claim.candidate.a.path_m) < self._wifi.independent_m:
                return max(gap_m, self._wifi.fingerprint_m)
        return self._wifi.independent_m
