"""The settings of WiFi: its scans, fingerprints, their similarity, and loop candidates."""

from dataclasses import dataclass, field

from wayfi.backend.options import option


@dataclass(frozen=True)
class WifiWatchConfig:
    """When a receiver's scans are not used, and when a fault of it is a complaint."""

    max_readings: int = option(1000, "", "of one scan; a phone in a mall was seen to hear 437: a flood is more")
    clock_s: float = option(2.0, "s", "off the odometry's: 1 m at 0.5 m/s, and closures are to be good to 1.5 m")
    level_change_m: float = option(0.5, "m", "of path, over which the RSSI of nine in ten was seen to change")
    silent_s: float = option(60.0, "s", "a phone may be kept to a scan every half minute")
    window_scans: int = option(20, "", "the latest, on which complaints of size and clock rest; drivers cut sweeps up")
    clock_faults: int = option(5, "", "of these scans: single ones come late, and gaps of the odometry hide some")
    constant_levels: int = option(
        18, "", "of the latest 20 heard again have the same RSSI; real receivers were seen to repeat 9"
    )
    window_levels: int = option(20, "", "the latest heard again, as above: one or two scans")
    faulty_readings: int = option(
        18, "", "of the latest 20 have no BSSID, no dBm or an age that is too high: single ones do"
    )
    window_faulty: int = option(20, "", "the latest readings, as above: one or two scans")
    old_s: float = option(
        30.0, "s", "of age, for which the path is kept; of real phones' readings nine in ten are below 21"
    )
    new_bssids: int = option(230, "", "of the latest 256 readings; real receivers were seen to have 145")
    window_readings: int = option(256, "", "the latest readings, as above: several scans")


@dataclass(frozen=True)
class ByPlaceConfig:
    """Readings of all ages, gathered where they were taken."""

    near_m: float = option(1.0, "m", "to each side: a phone that reports an access point once a metre leaves holes")
    together_s: float = option(0.5, "s", "of difference between ages, below which a scan was taken at one place")
    wait_quantile: float = option(0.9, "", "of a scan's ages: it waits so long for most readings of its place to come")


@dataclass(frozen=True)
class AccessPointConfig:
    """How the weights of access points are learnt."""

    near_m: float = option(2.0, "m", "of path, over which shadowing is alike")
    moved_m: float = option(0.25, "m", "of path: fingerprints nearer than this repeat each other")
    far_m: float = option(30.0, "m", "of path, beyond which RSSI is not alike")
    prior_near: float = option(0.6, "", "mean agreement of places near each other: a common access point's")
    prior_far: float = option(0.1, "", "mean agreement of places far apart, as above")
    prior_pairs: float = option(2.0, "", "pairs that the priors count for: a few metres of path outweigh them")
    revisits: float = option(10.0, "", "confirmed revisits that count as much as all that was heard in passing")
    memory_pairs: float = option(200.0, "", "pairs of the running mean: it follows a change within 100 m of path")
    min_weight: float = option(0.02, "", "of an access point that predicts no place; 0 leaves a similarity undefined")


@dataclass(frozen=True)
class SelfSimilarityConfig:
    """What a similarity means in metres, learnt on the robot's own path."""

    reach_m: float = option(12.0, "m", "further apart similarity depends on distance no more, and wheels begin to err")
    min_pairs: int = option(100, "", "of about one similarity: fewer make a poor mean")


@dataclass(frozen=True)
class ReceiversConfig:
    """The Kalman filter of the receivers' offsets in dB."""

    prior_sigma_db: float = option(4.0, "dB", "phones of one kind were seen 2 to 4 dB apart")
    one_place_m: float = option(1.0, "m", "of path: RSSI changes little over it, and fading is new after it")
    min_common: int = option(4, "", "access points: the median of fewer is one reading's fading")
    fading_db: float = option(5.0, "dB", "by which two readings of one access point differ at random")
    walk_db_per_sqrt_m: float = option(0.05, "dB per sqrt(m)", "what hands and heat change: half a dB in 100 m")


@dataclass(frozen=True)
class WifiConfig:
    """Fingerprints, their similarity, and loop candidates."""

    enabled: bool = option(True, "", "false runs on wheels and LiDAR alone")
    first_pose_s: float = option(5.0, "s", "a scan before the first pose waits so long for it: sensors start in turn")
    odometry_s: float = option(
        30.0, "s", "a scan waits so long for odometry that has paused; odometry.path_s keeps the path as long"
    )
    similarity_sigma_db: float = option(6.0, "dB", "the paper's sigma^2 = 36 dB^2")
    fingerprint_m: float = option(0.5, "m", "the mean over half a metre beats single scans, which fade")
    fingerprint_scans: int = option(20, "", "a robot that stands still needs no more for one mean")
    split_at: float = option(2.0, "", "times fingerprint_m: scans further apart are fingerprints of their own")
    still_m: float = option(0.02, "m", "of path: odometry of a robot that stands jitters by less")
    heard_share: float = option(0.25, "", "an access point heard in fewer of a fingerprint's scans is chance")
    min_readings: int = option(4, "", "fewer access points name no place")
    min_path_m: float = option(30.0, "m", "nearer along the path a closure adds nothing new (the paper: 50)")
    near_m: float = option(3.0, "m", "places nearer than this count as one: closures are to be good to this")
    near_gaps: float = option(1.5, "", "of the fingerprints' spacing, if that is more: phones scan every 2 to 4 s")
    min_near: float = option(0.6, "", "how likely they must be that near, by the robot's own path")
    sigma_of_rms: float = option(
        0.5, "", "two axes share the rms (1/sqrt(2)), and the best match has half of the variance of any (1/sqrt(2))"
    )
    candidate_every_m: float = option(0.4, "m", "one for each fingerprint of a receiver: single loops have few")
    neighbouring_m: float = option(
        4.0, "m", "of path around the later place, in which it must be the most similar to the earlier one"
    )
    independent_m: float = option(10.0, "m", "shadowing is alike over this length: so much path counts as one fix")
    watch: WifiWatchConfig = field(default_factory=WifiWatchConfig)
    by_place: ByPlaceConfig = field(default_factory=ByPlaceConfig)
    access_points: AccessPointConfig = field(default_factory=AccessPointConfig)
    self_similarity: SelfSimilarityConfig = field(default_factory=SelfSimilarityConfig)
    receivers: ReceiversConfig = field(default_factory=ReceiversConfig)
