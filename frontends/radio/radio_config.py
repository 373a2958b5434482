"""The settings of the radio map: how radio waves fade in a building, and what is told of it."""

from dataclasses import dataclass

from wayfi.backend.options import option


@dataclass(frozen=True)
class RadioConfig:
    """Section `radio`: access points and coverage of a saved map."""

    place_m: float = option(2.0, "m", "readings within it are one place: shadowing is alike over 2 to 8 m indoors")
    cell_m: float = option(1.0, "m", "of the map of levels; finer shows nothing that 2 m of place_m can tell")
    reach_m: float = option(4.0, "m", "from the nearest reading: the length over which shadowing was seen to be alike")
    shadow_db: float = option(5.0, "dB", "log-normal shadowing indoors: 4 to 8 in the literature")
    shadow_m: float = option(5.0, "m", "the length over which shadowing is alike: 2 to 8 indoors")
    fading_db: float = option(3.0, "dB", "of one reading at one place; 2 to 4 was seen")
    within_place_db: float = option(1.5, "dB", "by which the level changes within place_m, however many readings")
    power_dbm: float = option(-38.0, "dBm", "at 1 m: 15 to 20 dBm less 40 dB of path loss, less a ceiling or wall")
    power_sigma_db: float = option(10.0, "dB", "floors and walls before the building's own take 0 to 25 dB")
    exponent: float = option(3.2, "", "of path loss indoors: 2 along corridors, 4 through walls")
    exponent_sigma: float = option(0.7, "", "of it: free space has 2, three walls in a row over 4")
    attenuation_db_per_m: float = option(0.3, "dB/m", "of walls in a row, in addition: 0 in halls, 1 in offices")
    attenuation_sigma: float = option(0.4, "dB/m", "as above")
    height_m: float = option(2.0, "m", "of an access point above the receiver: one at the ceiling, a robot's antenna")
    margin_m: float = option(40.0, "m", "around what was driven, in which access points are looked for: 20 dB of walls")
    min_places: int = option(4, "", "heard at fewer, an access point's position is not claimed")
    moved_log_odds: float = option(12.0, "", "for two positions against one: e^12 is one in 160,000, of 1,000 boxes")
    carried_share: float = option(0.8, "", "of all places, at which one that rides on the robot is heard")
    carried_db: float = option(4.0, "dB", "within which its level stays; over 30 m any other changes by 10 dB or more")
    carried_dbm: float = option(-65.0, "dBm", "or more: within a metre it is; far from all places, a level one is weak")
    carried_path_m: float = option(20.0, "m", "across what was driven; over less, a far access point is level too")
    usable_dbm: float = option(-75.0, "dBm", "below it is a hole: wireless data wants -70 to -75, speech -67")
