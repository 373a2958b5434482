"""Several robots, one map: daemons serve the maps they make, a merging one joins them and serves the common map."""
