"""The names of the frames."""

from dataclasses import dataclass

from wayfi.backend.options import option


@dataclass(frozen=True)
class FramesConfig:
    """The names of the frames in what is published and saved, REP 105's by default; a fleet prefixes its robots'."""

    map: str = option("map", "frame", "of poses, the grid, and fixes from outside; one for all robots of a map")
    common: str = option("common_map", "frame", "of the map that a fleet shares: the parent of map in each robot's /tf")
    odom: str = option("odom", "frame", "the child of map on /tf, and the odometry's own frame: robot1/odom in a fleet")
    base_link: str = option("base_link", "frame", "the robot's, in saved maps; for mounts see odometry.base_frame")
