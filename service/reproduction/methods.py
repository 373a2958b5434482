"""The methods of the paper's Table III and the stages of its Table IV, in their order."""

from enum import StrEnum


class Method(StrEnum):
    """A method of estimating the trajectory."""

    ODOMETRY = "odometry"
    GMAPPING = "GMapping"
    SIMILARITY_MODEL = "similarity model"
    WIFI = "WiFi"
    CLOSE_SCANS = "WiFi + close scans"
    TENTH = "WiFi + close scans + 10 %"
    TWO_FIFTHS = "WiFi + close scans + 40 %"


class Stage(StrEnum):
    """A stage of Algorithm 1."""

    WIFI_CLOSURES = "WiFi closures"
    FIRST_OPTIMISATION = "first optimisation"
    CLOSE_SCANS = "close scans"
    TENTH = "10 % more scans"
    SECOND_OPTIMISATION = "second optimisation"
    TWO_FIFTHS = "40 % more scans"
    SECOND_OPTIMISATION_TWO_FIFTHS = "second optimisation, 40 %"
