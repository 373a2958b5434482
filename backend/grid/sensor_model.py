"""The inverse sensor model: the evidence that a scan gives a cell, in int8 units of one ray that passes.

A fixed step up where a ray ends and a fixed step down where it passes, summed between bounds: OctoMap's (Hornung et
al. 2013, section 3.2).
"""

LOG_ODDS = 0.4  # of one unit: a ray that passes leaves a probability of 0.40 (OctoMap's)
PASS = -1  # the unit
HIT = 3  # with 2, rays that graze walls from afar erase a twentieth of them; with 4, false returns stay
MIN_EVIDENCE = -5  # p = 0.12, OctoMap's: a cell that was free for long is occupied (p = 0.83) after three hits
MAX_EVIDENCE = 9  # p = 0.97, OctoMap's: a long-seen wall is unsure after eight passes, free (p = 0.23) after twelve
MAX_SCANS = 40  # in one patch: HIT times as many stay within an int8
