"""The settings of WiFi: fingerprints, their similarity, and loop candidates."""

from dataclasses import dataclass

from wayfi.backend.options import option


@dataclass(frozen=True)
class WifiConfig:
    """Fingerprints, their similarity, and loop candidates."""

    enabled: bool = option(True, "", "false runs on wheels and LiDAR alone")
    similarity_sigma_db: float = option(6.0, "dB", "the paper's sigma^2 = 36 dB^2")
    fingerprint_m: float = option(0.5, "m", "the mean over half a metre beats single scans, which fade")
    fingerprint_scans: int = option(20, "", "a robot that stands still needs no more for one mean")
    heard_share: float = option(0.25, "", "an access point heard in fewer of a fingerprint's scans is chance")
    min_readings: int = option(4, "", "fewer access points name no place")
    min_path_m: float = option(30.0, "m", "nearer along the path a closure says nothing new (the paper: 50)")
    near_m: float = option(3.0, "m", "places nearer than this count as one: closures are to be good to this")
    min_near: float = option(0.6, "", "how likely they must be that near, by the robot's own path")
    candidate_every_m: float = option(0.4, "m", "one for each fingerprint of a receiver: single loops have few")
    neighbouring_m: float = option(
        4.0, "m", "of path each way from the later place, none more like the earlier than it is"
    )
    independent_m: float = option(10.0, "m", "shadowing is alike over this length: so much path counts as one fix")
