"""The variance factor: right covariances leave it at 1, and it finds by how much others are wrong."""

import numpy as np
import pytest

from wayfi.backend.graph.variance_factor import LEAST, MOST, TYPICAL, VarianceFactor


def after(innovations: list[float], prior_count: float = 5.0) -> float:
    factor = VarianceFactor(prior_count)
    for chi2 in innovations:
        factor.add(chi2)
    return factor.value


@pytest.mark.parametrize("too_large", [0.05, 0.3, 1.0])
def test_it_finds_by_how_much_covariances_are_too_large(too_large: float) -> None:
    innovations = too_large * np.random.default_rng(0).chisquare(3, 500)
    assert after(innovations.tolist()) == pytest.approx(too_large, rel=0.15)


def test_twenty_closures_find_most_of_it() -> None:
    innovations = 0.05 * np.random.default_rng(1).chisquare(3, 20)
    assert after(innovations.tolist(), 3.0) < 0.12


def test_it_is_1_before_anything_is_known_and_one_innovation_changes_little() -> None:
    assert after([]) == 1.0
    assert after([1e6]) == pytest.approx((MOST / TYPICAL) ** (1 / 6))


@pytest.mark.parametrize(("chi2", "bound"), [(0.0, LEAST / TYPICAL), (1e9, MOST / TYPICAL)])
def test_whatever_closures_say_it_stays_within_bounds(chi2: float, bound: float) -> None:
    value = after([chi2] * 10_000)
    assert value == pytest.approx(bound, rel=0.01)
