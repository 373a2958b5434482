"""The settings of floors."""

from dataclasses import dataclass

from wayfi.backend.options import option


@dataclass(frozen=True)
class FloorConfig:
    """What an elevator looks like to the laser and to WiFi, and how floors are told apart."""

    cabin_m: float = option(2.0, "m", "from the laser to nine of ten points: a cabin of 2.2 m, however it stands there")
    cabin_points: int = option(40, "points", "at least: 2.4 m of wall at 6 cm")
    still_m: float = option(0.5, "m", "of path: a robot stands in an elevator, and WiFi hears one place as it does")
    changed: float = option(0.3, "", "of the usual similarity of two scans of one place: less is another floor")
    leaving_m: float = option(1.0, "m", "of path from the cabin to where a scan tells the floor: its walls are behind")
    silent_m: float = option(20.0, "m", "of path without a WiFi scan after a cabin: the floor is taken to be the same")
    near_m: float = option(15.0, "m", "around the robot: the fingerprints that a scan is compared with on each floor")
    same: float = option(0.3, "", "of the usual similarity, to the best of them: it is half at 4 m, 0.1 a floor away")
    memory: float = option(0.95, "", "of the usual similarity from scan to scan: it follows in about 20")
