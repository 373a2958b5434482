"""The settings of WiFi's belief about the place."""

from dataclasses import dataclass, field

from wayfi.backend.options import option


@dataclass(frozen=True)
class LikelihoodConfig:
    """How likely a WiFi scan is at a place of the map."""

    place_m: float = option(1.0, "m", "side of a place: RSSI changes by 1 dB over it, less than it fades")
    smoothing_m: float = option(0.7, "m", "sigma of the mean over fingerprints around a place: one alone fades")
    level_db: float = option(
        4.0, "dB", "sigma of RSSI at one place; 2.7 to 3.5 were measured, on another day and facing on"
    )
    day_db: float = option(2.0, "dB", "by which RSSI at a place differs from day to day; 1.9 to 2.6 were measured")
    gradient_db_per_m: float = option(
        1.0, "dB/m", "growth of that sigma away from the fingerprints; 10.6 dB were measured at 10 m"
    )
    range_db: float = option(20.0, "dB", "that RSSI is spread over near a map: places just outside it fit moderately")
    changed: float = option(0.15, "", "of the access points, which were moved or switched since the map was made")
    absent: float = option(0.05, "", "chance to hear an access point where the map never did")
    heard: float = option(0.85, "", "chance to hear one that the map always heard: receivers miss some")
    new_nats: float = option(
        1.0, "nats", "against the map for each access point that it does not know, above as many that it knows"
    )
    unknown_heard: float = option(0.5, "", "times as often as all over the map it is heard where nothing is known")
    independent_aps: float = option(
        10.0, "", "access points that say as much as any number: those of one device fade and change together"
    )
    siblings: float = option(2.0, "", "BSSIDs of one device, which say the same")
    independent_m: float = option(2.0, "m", "of path, over which shadowing is new: scans nearer share their evidence")
    standing: float = option(0.1, "", "of a scan's evidence that counts where the robot has not moved since the last")
    offset_db: float = option(6.0, "dB", "sigma of an unknown receiver's offset; phones were seen 8 dB apart")
    known_offset_db: float = option(2.0, "dB", "sigma of the offset of a receiver that the map knows")


@dataclass(frozen=True)
class WifiBeliefConfig:
    """Where WiFi and wheels put the robot in a known map."""

    particles: int = option(1500, "", "poses: 20 headings at each of 75 places; an update of them takes 2 ms")
    seeds: int = option(150, "", "of them begin anew at each scan, where it fits: a robot that was moved is found")
    elsewhere: float = option(0.01, "", "chance at a scan that the robot is moved elsewhere: some scans outweigh it")
    outside: float = option(0.003, "", "chance at a scan that it leaves the map")
    around: float = option(0.3, "", "chance that a robot in the map is up to 10 m off the ways that were driven")
    within_map: float = option(
        2.0,
        "times",
        "as much a scan counts between places of the map as between them and none, where the map does not tell",
    )
    begins_outside: float = option(0.5, "", "chance that a robot that is switched on is not in this map")
    roughening_m: float = option(0.15, "m", "by which particles drawn twice part: wheels are too sure")
    roughening_rad: float = option(0.03, "rad", "as above")
    near_m: float = option(5.0, "m", "particles this near to a peak are one place")
    sigma_floor_m: float = option(0.5, "m", "of a place: half a cell of the places that are compared")
    likelihood: LikelihoodConfig = field(default_factory=LikelihoodConfig)


@dataclass(frozen=True)
class CoarseClaimConfig:
    """When WiFi and wheels alone may claim a pose."""

    confirm_weight: float = option(0.8, "", "of the belief that a place must hold")
    keep_weight: float = option(0.6, "", "of the belief with which a claimed place stays so")
    in_map: float = option(0.5, "", "of the belief that all places together hold: with less it is not in this map")
    sigma_m: float = option(2.5, "m", "of the place: right within 3 m is what WiFi is good for")
    sigma_rad: float = option(0.6, "rad", "of the heading, which driving tells")
    path_m: float = option(2.0, "m", "of path over which a place is confirmed, or given up: shadowing is new after it")
