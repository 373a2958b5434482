"""The similarity model: distance as a function of similarity."""

import numpy as np
import pytest
from reproduced_drives import path_of, radio, ring, silent

from wayfi.service.reproduction.errors import ReproductionError
from wayfi.service.reproduction.similarities import all_similarities
from wayfi.service.reproduction.similarity_model import SimilarityModel, distance_closures, learn_model


def test_the_more_alike_two_fingerprints_are_the_nearer_they_stand() -> None:
    truth = ring(2)
    similarity = all_similarities(radio(truth[:, :2]), silent)
    model = learn_model(similarity, truth, path_of(truth))
    assert len(model.similarity) > 8
    assert (np.diff(model.similarity) > 0).all()
    assert (np.diff(model.distance_m) < 0).all()
    assert (model.sigma_m > 0).all()


def test_the_model_is_learnt_over_short_distances_alone() -> None:
    """The second lap of the odometry is far from the first, which is as similar as can be."""
    truth = ring(2)
    similarity = all_similarities(radio(truth[:, :2]), silent)
    torn = truth + np.array([1000.0, 0.0, 0.0]) * (np.arange(len(truth)) >= 144)[:, None]
    assert learn_model(similarity, torn, path_of(torn)).distance_m.max() < 20.0


def test_between_its_bins_the_model_is_interpolated() -> None:
    model = SimilarityModel(np.array([0.2, 0.6]), np.array([8.0, 2.0]), np.array([3.0, 1.0]))
    similarity = np.array([[1.0, 0.4, 0.9], [0.4, 1.0, 0.0], [0.9, 0.0, 1.0]], np.float32)
    found = distance_closures(np.array([(0, 1), (0, 2), (1, 2)]), similarity, model)
    np.testing.assert_allclose(found.distance_m, [5.0, 2.0, 8.0], atol=1e-6)
    np.testing.assert_allclose(found.sigma_m, [2.0, 1.0, 3.0], atol=1e-6)


def test_of_three_fingerprints_no_model_is_learnt() -> None:
    with pytest.raises(ReproductionError, match="too few"):
        learn_model(np.eye(3, dtype=np.float32), ring(1)[:3], np.arange(3.0))
