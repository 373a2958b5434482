"""The variance factor: right covariances leave it at 1, and it finds by how much others are wrong."""

import numpy as np
import pytest

from wayfi.backend.graph.variance_factor import MOST, VarianceFactor


@pytest.mark.parametrize("too_large", [0.05, 0.3, 1.0])
def test_it_finds_by_how_much_covariances_are_too_large(too_large: float) -> None:
    factor, rng = VarianceFactor(5.0), np.random.default_rng(0)
    for chi2 in too_large * rng.chisquare(3, 500):
        factor.add(float(chi2), 3)
    assert factor.value == pytest.approx(too_large, rel=0.15)


def test_it_is_1_before_anything_is_known_and_one_innovation_changes_little() -> None:
    factor = VarianceFactor(5.0)
    assert factor.value == 1.0
    factor.add(1e6, 3)
    assert factor.value == pytest.approx((5.0 + MOST) / 6.0)
