"""The settings of merging two maps."""

from dataclasses import dataclass

from wayfi.backend.options import option


@dataclass(frozen=True)
class MergingConfig:
    """When two maps are believed to overlap, and how."""

    min_similarity: float = option(0.15, "", "of fingerprints of one place; of other buildings 0.1 was not seen")
    cell_m: float = option(2.0, "m", "of places that the same motion of one map brings together")
    heading_step: float = option(0.05, "rad", "between the headings tried: 1 m at 20 m, half a cell")
    near_m: float = option(4.0, "m", "between the places of two like fingerprints that the motion explains")
    independent_m: float = option(5.0, "m", "of places: what WiFi says of those nearer to each other counts once")
    min_places: int = option(5, "places", "5 m apart, that WiFi must bring together: chance brought 3, small storeys 7")
    min_explained: float = option(0.5, "", "of like fingerprints; in maps of one building 0.99 were")
    max_rival: float = option(0.6, "", "of the support of the best motion: nearer than this it is ambiguous")
    wifi_sigma_m: float = option(1.0, "m", "of what WiFi says, from which the laser searches")
    wifi_sigma_rad: float = option(0.05, "rad", "as above")
    min_spread_m: float = option(10.0, "m", "between places that agree: nearer ones see the same walls")
    check_every_m: float = option(5.0, "m", "of path between two scans that the laser compares at first")
    tie_every_m: float = option(3.0, "m", "of path between two that relate the maps in the end")
    agree_m: float = option(0.5, "m", "between the places that two checks give; what good maps bend by in 100 m")
    agree_rad: float = option(0.05, "rad", "as above")
    min_checks: int = option(5, "checks", "that agree by the laser, where WiFi says the same")
    min_checks_alone: int = option(12, "checks", "that agree where the laser is alone: halls look alike")
    min_searched: int = option(6, "parts", "of a map, that the laser alone finds in the other at places that agree")
    min_found: float = option(0.4, "", "of the parts searched for; the maps of two drives may cover other rooms")
    min_agreeing: float = option(0.5, "", "of the checks where both maps have scans")
    max_seen_through: float = option(0.25, "", "of walls in view, in the median over those places: a map changes a lot")
    wifi_alone_places: int = option(12, "places", "independent, where there is no laser to confirm them")
    remove_chi2: float = option(25.0, "", "of a tie that the joined map contradicts: it is left out")
    floors_agree_m: float = option(
        1.0, "m", "between where two floors put the same elevator; 0.04 in simulated buildings"
    )
    floors_agree_rad: float = option(
        0.1, "rad", "as above, of the headings; 0.005: wheels alone carry them out of an elevator"
    )
