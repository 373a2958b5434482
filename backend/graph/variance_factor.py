"""The variance factor of the estimate: by how much its covariances are too large or too small.

The variance of unit weight of adjustment theory: every measurement's noise is known up to one common factor, which the
innovations of independent measurements tell. The estimate does not depend on it, its covariance is proportional to it.
"""

import math

# Of one innovation, per degree of freedom: a tenth of the claimed sigma, and what passes the gate against the estimate.
LEAST, MOST = 0.01, 3.0
TYPICAL = 0.691  # exp(E[log(chi2 / 3)]) of 3 degrees of freedom: the geometric mean where covariances are right


class VarianceFactor:
    """The geometric mean of closures' normalised innovations squared, over what it is where covariances are right.

    `prior_count` imagined closures with right covariances count with them. In an arithmetic mean these would outweigh
    hundreds of closures whose covariances are thirty times too large.
    """

    def __init__(self, prior_count: float) -> None:
        self._count, self._sum = prior_count, 0.0

    @property
    def value(self) -> float:
        """What the graph's covariances are to be multiplied by."""
        return math.exp(self._sum / self._count)

    def add(self, chi2: float) -> None:
        """Add an innovation: its squared Mahalanobis distance, of 3 degrees of freedom."""
        self._count += 1
        self._sum += math.log(min(max(chi2 / 3, LEAST), MOST) / TYPICAL)
