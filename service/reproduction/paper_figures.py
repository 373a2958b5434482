"""The figures printed in the paper (Ismail et al., arXiv 2206.08733), of a drive of 1,072.6 m in 2,583 s.

They are only shown for comparison; no computation uses them.
"""

from wayfi.service.reproduction.methods import Method, Stage
from wayfi.service.reproduction.sweep_figures import SweepFigures

DRIVE_S = 2583.0

WINDOWS = {
    20: SweepFigures(1038, 2.93, 0.48, 306.0, 2.87),
    40: SweepFigures(620, 1.05, 0.23, 364.0, 2.75),
    80: SweepFigures(396, 0.57, 0.10, 652.0, 2.70),
    120: SweepFigures(257, 0.47, 0.11, 1138.0, 3.66),
}
"""Table I, by w; k is 2."""

NEIGHBOURS = {
    1: SweepFigures(426, 0.72, 0.11, None, 2.83),
    2: SweepFigures(396, 0.57, 0.10, None, 2.70),
    4: SweepFigures(320, 0.72, 0.11, None, 2.77),
    8: SweepFigures(265, 0.99, 0.13, None, 3.83),
}
"""Table II, by k; w is 80. The paper gives no seconds there."""

ATE_M = {
    Method.ODOMETRY: 54.7,
    Method.GMAPPING: 4.31,
    Method.SIMILARITY_MODEL: 3.91,
    Method.WIFI: 2.70,
    Method.CLOSE_SCANS: 1.56,
    Method.TENTH: 0.92,
    Method.TWO_FIFTHS: 0.88,
}
"""Table III."""

SECONDS = {
    Stage.WIFI_CLOSURES: 364.0,  # Table I gives this for w = 40, Table IV for w = 80
    Stage.FIRST_OPTIMISATION: 2.76,
    Stage.CLOSE_SCANS: 917.0,
    Stage.TENTH: 3888.0,
    Stage.SECOND_OPTIMISATION: 2.84,
}
"""Table IV; the paper gives no time for 40 %."""
