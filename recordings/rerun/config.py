"""The `rerun` section of the configuration: size and rates of the Rerun log, and where it is served."""

from dataclasses import dataclass

from wayfi.backend.options import option


@dataclass(frozen=True)
class RerunConfig:
    """Section `rerun`: the log of a run, in a file and live."""

    enabled: bool = option(True, "", "shows what the system believed and why; replay --no-rrd leaves it out")
    port: int = option(9876, "", "the port a Rerun viewer connects to unless told otherwise; bound to 127.0.0.1")
    server_memory_limit: str = option("256MiB", "", "history for viewers that connect late; a car park takes 100 MB")
    part_mb: float = option(256.0, "MiB", "a daemon starts its next file at this size, with the map so far")
    pose_hz: float = option(1.0, "Hz", "0.4 m between two logged poses of a robot at 0.4 m/s")
    scan_hz: float = option(1.0, "Hz", "the current scan and the local submap: a keyframe a second at 0.4 m/s")
    wifi_hz: float = option(0.25, "Hz", "a bar chart costs 1 ms; a fingerprint every two seconds says little new")
    grid_cells_per_s: float = option(1e5, "cells/s", "a grid of 2.4 million cells every 24 s: the log stays linear")
    scan_points: int = option(400, "points", "enough to see the walls of one keyframe; 3 kB a keyframe")
    submap_keyframes: int = option(10, "keyframes", "one frame to move in a correction; about 4 m of driving")
