"""How many dB each receiver reads above the map's reference, learnt where the robot is found."""

from collections.abc import Mapping

from wayfi.frontends.localization.wifi.belief_config import LikelihoodConfig
from wayfi.frontends.wifi.receivers import ReceiverOffset

MOST_RECEIVERS = 32  # that are remembered, to bound memory
LEAST_SIGMA_DB = 0.5  # a receiver warms up, and is carried another way
MOST_READINGS = 4.0  # of one scan that count: they fade together


class ReceiverOffsets:
    """A Kalman filter for each receiver, of which the map knows some."""

    def __init__(self, known: Mapping[str, ReceiverOffset], config: LikelihoodConfig) -> None:
        self._config = config
        self._offsets = {r: ReceiverOffset(o.offset_db, config.known_offset_db) for r, o in known.items()}

    def of(self, receiver: str) -> ReceiverOffset:
        """The offset of a receiver; 0 with a wide sigma of one that has not been heard."""
        return self._offsets.get(receiver, ReceiverOffset(0.0, self._config.offset_db))

    def learn(self, receiver: str, offset_db: float, readings: float) -> None:
        """Update by an offset from so many `readings`."""
        if readings <= 0.0 or (receiver not in self._offsets and len(self._offsets) >= MOST_RECEIVERS):
            return
        before = self.of(receiver)
        variance = self._config.level_db**2 / min(readings, MOST_READINGS)
        gain = before.sigma_db**2 / (before.sigma_db**2 + variance)
        sigma_db = max((1.0 - gain) ** 0.5 * before.sigma_db, LEAST_SIGMA_DB)
        self._offsets[receiver] = ReceiverOffset(before.offset_db + gain * (offset_db - before.offset_db), sigma_db)
