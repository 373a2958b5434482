"""The settings of loop closures: which candidates are checked, and when WiFi's agree with each other."""

from dataclasses import dataclass, field

from wayfi.backend.options import option


@dataclass(frozen=True)
class ConsensusConfig:
    """When WiFi's claims agree, and when a claim is accepted or removed."""

    steps: int = option(241, "", "over the reach each way: 0.001 rad/m apart, 0.1 rad over 100 m")
    no_axes: float = option(1e-4, "", "that what passed for a building's axes is none, as in a round hall")
    reach_sigmas: float = option(
        4.0, "", "of the prior's turn bias, each way: the wheels of one robot in 16,000 are beyond"
    )
    drift: float = option(0.01, "1", "of the path between two places: what the wheels of real robots err at random")
    min_gain: float = option(4.0, "", "nats by which another bias must be better, while more claims may come: 55 to 1")
    min_gain_at_end: float = option(1.0, "", "the same at the end, when there is nothing to wait for")
    min_posterior: float = option(0.9, "", "of a claim to be true, given the estimate, before it enters the graph")
    max_apart_m: float = option(3.0, "m", "an accepted claim whose places end further apart is removed")
    max_apart_sigmas: float = option(3.5, "", "as above, of its own sigma: 1 in 500 true claims is beyond")
    prior_pairs: float = option(
        50.0, "claims", "that the sigma of the self-similarity counts for against accepted ones"
    )
    search_growth: float = option(
        1.2,
        "",
        "times the refused claims at the last search: a new search costs as much, and finds nothing new with fewer",
    )
    window: int = option(500, "claims", "the newest: bounds the cost; some hours of a robot that keeps coming back")


@dataclass(frozen=True)
class OverlapConfig:
    """When a check may pass with fewer inliers, because most points were out of the earlier scans' sight."""

    min_inlier_ratio: float = option(0.25, "", "a 180-degree laser that comes back the other way has 0.2 to 0.5")
    min_agreement: float = option(
        0.75, "", "points that fit, of these and those seen through; right poses were seen to have 0.8 and more"
    )
    max_expected_sigma_m: float = option(
        0.35, "m", "of the estimate: fewer points must not choose among places a rack's depth, 1 m, apart"
    )


@dataclass(frozen=True)
class LostRobotConfig:
    """How the map is searched for a robot that was moved, and when two scans agree on where it is."""

    places_m: float = option(3.0, "m", "between places: the search reaches 4 m to each side of them")
    confirm_m: float = option(3.0, "m", "of path between the two scans: nearer they see much the same, and err alike")
    drop_m: float = option(10.0, "m", "of path without a second scan that fits: the first one may have been wrong")
    agree_m: float = option(
        0.3, "m", "between the places that two scans give: what a map bends by, and less than a rack"
    )
    agree_rad: float = option(0.05, "rad", "as above")


@dataclass(frozen=True)
class FixesConfig:
    """How well a pose from outside is known where it does not say so, and when several outvote the estimate."""

    sigma_m: float = option(0.2, "m", "of a fix without a covariance: a fiducial at some metres, a dock")
    sigma_rad: float = option(0.1, "rad", "as above")
    agreeing: int = option(3, "fixes", "that contradict the estimate and agree with each other: it was wrong")
    spread_m: float = option(10.0, "m", "of path between them: one marker that was moved is seen over less")
    wheels: float = option(0.03, "1", "of the path between two of them: what calibrated wheels err by, and turn")
    wheels_rad_per_m: float = option(0.01, "rad/m", "as above")
    compared: int = option(10, "fixes", "the newest refused ones: bounds the cost of comparing them")


@dataclass(frozen=True)
class ClosureConfig:
    """Which candidates are checked, how far the check searches, and which of its results become factors."""

    radius_m: float = option(5.0, "m", "the paper: LiDAR closures between poses that the estimate puts this near")
    min_path_m: float = option(15.0, "m", "nearer along the path the local submap has already closed it")
    check_every_m: float = option(1.0, "m", "checks nearer to each other see the same walls")
    closed_m: float = option(
        6.0, "m", "along the path and the newest closures: between keyframes this near, another one adds nothing"
    )
    turn_cost_m_per_rad: float = option(
        0.5, "m/rad", "of two keyframes as near, the one that looked the same way overlaps more"
    )
    submap_reach: int = option(7, "keyframes", "on each side of the candidate: 7 m of path")
    min_window_m: float = option(0.4, "m", "to each side, however small the covariance: the estimate may be wrong")
    min_window_rad: float = option(0.1, "rad", "as above")
    max_window_m: float = option(4.0, "m", "beyond it aisles repeat; bounds the poses examined")
    max_window_rad: float = option(0.5, "rad", "as above; any heading where the sigma of the heading is over it")
    min_inlier_ratio: float = option(0.6, "", "the paper's half admits a neighbouring aisle")
    max_sigma_m: float = option(0.15, "m", "a closure that is looser along some direction is not a fix")
    open_sigma_m: float = option(30.0, "m", "along walls that leave it open: far more than any estimate it meets")
    walls_above: float = option(
        0.3, "", "of WiFi's sigma: to an estimate that is surer WiFi adds less than a tenth of what it knows"
    )
    max_second_peak: float = option(0.85, "", "of the best score: nearer than this the place is ambiguous")
    gate_chi2: float = option(9.0, "", "97 % of true closures pass at 3 degrees of freedom, an aisle too far does not")
    drift: float = option(0.002, "1", "of the path: errors of scan matching that add up one way, as 0.2 % were seen to")
    drift_rad_per_m: float = option(0.0003, "rad/m", "the same of the heading: 1 degree over 60 m")
    remove_chi2: float = option(25.0, "", "an accepted closure that stays this far off is removed")
    variance_prior: float = option(
        10.0,
        "closures",
        "that count for the graph's covariances as they are: five closures of a short drive may agree by chance",
    )
    reviewed: int = option(20, "closures", "the newest accepted ones: those that a new one may contradict or shorten")
    sigma_floor_m: float = option(0.02, "m", "submaps bend by this much over their length")
    sigma_floor_rad: float = option(0.004, "rad", "as above")
    overlap: OverlapConfig = field(default_factory=OverlapConfig)
    lost: LostRobotConfig = field(default_factory=LostRobotConfig)
    consensus: ConsensusConfig = field(default_factory=ConsensusConfig)
    fixes: FixesConfig = field(default_factory=FixesConfig)
