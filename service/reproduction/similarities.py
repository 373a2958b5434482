"""The similarity of all pairs of fingerprints."""

import numpy as np
from numpy.typing import NDArray

from wayfi.frontends.wifi.fingerprint_index import FingerprintIndex
from wayfi.frontends.wifi.readings import Readings
from wayfi.service.reproduction.messages import Progress

SIGMA_DB = 6.0  # the paper's sigma^2 = 36 dB^2

Similarities = NDArray[np.float32]


def all_similarities(readings: list[Readings], progress: Progress) -> Similarities:
    """(n, n) similarities of n fingerprints as defined by `FingerprintIndex`: symmetric, 1 on the diagonal."""
    index = FingerprintIndex(SIGMA_DB)
    n = len(readings)
    similarity = np.eye(n, dtype=np.float32)
    for one in readings:
        number = index.add(one)
        similarity[number, :number] = similarity[:number, number] = index.similarity(number)
        progress((number + 1) / n)
    return similarity
