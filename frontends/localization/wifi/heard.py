"""What was heard at places, as arrays."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class Heard(NamedTuple):
    """Of row k: the access points `aps[starts[k]:starts[k + 1]]`, their `rssi` (dBm), and the `share` that heard it."""

    starts: NDArray[np.int64]
    aps: NDArray[np.int32]
    rssi: NDArray[np.float32]
    share: NDArray[np.float32]

    def rows(self) -> NDArray[np.int64]:
        """(entries,) the row of each entry."""
        return np.repeat(np.arange(len(self.starts) - 1), np.diff(self.starts))
