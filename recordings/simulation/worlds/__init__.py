"""The worlds that can be simulated: the walls, route and access points of each, and the laser that scans it."""
