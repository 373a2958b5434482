"""The similarity of all pairs of fingerprints."""

import numpy as np
from reproduced_drives import radio, ring, silent

from wayfi.service.reproduction.similarities import all_similarities


def test_similarity_is_symmetric_one_with_itself_and_falls_with_distance() -> None:
    similarity = all_similarities(radio(ring(1)[:, :2]), silent)
    np.testing.assert_array_equal(similarity, similarity.T)
    np.testing.assert_array_equal(np.diag(similarity), 1.0)
    assert similarity.min() >= 0.0
    near, further, far = (float(np.mean([similarity[i, i + k] for i in range(60)])) for k in (1, 6, 20))
    assert near > further > far
