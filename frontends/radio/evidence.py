"""What is known of one box for its position and level: where it was heard at which level, and where it was not."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wayfi.frontends.radio.boxes import Box
from wayfi.frontends.radio.propagation import Heard
from wayfi.frontends.radio.radio_config import RadioConfig
from wayfi.frontends.radio.survey import Survey

MOST_HEARD, MOST_SILENT = 250, 150  # places for one box; the cost grows with the square of them


@dataclass(frozen=True, slots=True, eq=False)
class Evidence:
    """What was `heard`, with the epochs of the places where it was (m,), and where it was silent (c,)."""

    heard: Heard
    epochs: NDArray[np.int64]
    silent_epochs: NDArray[np.int64]

    @property
    def latest_epoch(self) -> int:
        """The newest epoch in which something was heard."""
        return int(self.epochs.max())

    def before(self, epoch: int) -> "Evidence":
        """What is known of the time before an epoch."""
        return self._part(self.epochs < epoch, self.silent_epochs < epoch)

    def since(self, epoch: int) -> "Evidence":
        """What is known of the time from an epoch on."""
        return self._part(self.epochs >= epoch, self.silent_epochs >= epoch)

    def _part(self, chosen: NDArray[np.bool_], silent: NDArray[np.bool_]) -> "Evidence":
        whole = self.heard
        part = Heard(
            whole.xy[chosen], whole.level[chosen], whole.variance[chosen], whole.silent_xy[silent], whole.limit_dbm
        )
        return Evidence(part, self.epochs[chosen], self.silent_epochs[silent])


def evidence_of(box: Box, heard: Survey, config: RadioConfig) -> Evidence:
    """What a survey tells of a box.

    Near the limit a miss says that the level was below it then, and lowers the mean; elsewhere it is chance.
    """
    near_limit = box.level < heard.limit_dbm + 2 * config.shadow_db
    level = np.where(near_limit, box.share * box.level + (1 - box.share) * heard.limit_dbm, box.level)
    loud = _thinned(np.flatnonzero(box.readings > 0), MOST_HEARD)
    silent = _thinned(np.flatnonzero(box.readings == 0), MOST_SILENT)
    variance = config.within_place_db**2 + config.fading_db**2 / box.readings[loud]
    known = Heard(heard.xy[loud], level[loud], variance, heard.xy[silent], heard.limit_dbm)
    return Evidence(known, heard.epoch[loud], heard.epoch[silent])


def _thinned(numbers: NDArray[np.int64], most: int) -> NDArray[np.int64]:
    """At most `most` of the numbers, evenly spaced."""
    return numbers[:: max(1, -(-len(numbers) // most))]
