"""The views of the Rerun log, one in each file."""
