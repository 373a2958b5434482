"""The variance factor of the estimate: by how much its covariances are too large or too small.

The variance of unit weight of adjustment theory: every measurement's noise is known up to one common factor, which the
innovations of independent measurements tell. The estimate does not depend on it, its covariance is proportional to it.
"""

MOST = 3.0  # of one innovation, per degree of freedom: what passes the gate against the estimate


class VarianceFactor:
    """The mean normalised innovation squared of closures; `prior_count` imagined ones of 1 count with them."""

    def __init__(self, prior_count: float) -> None:
        self._count = self._sum = prior_count

    @property
    def value(self) -> float:
        """What the graph's covariances are to be multiplied by."""
        return self._sum / self._count

    def add(self, chi2: float, degrees_of_freedom: int) -> None:
        """Add an innovation: its squared Mahalanobis distance, which is `degrees_of_freedom` in the mean if right."""
        self._count += 1
        self._sum += min(chi2 / degrees_of_freedom, MOST)
