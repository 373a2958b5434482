"""The result files of a drive: trajectories, tables, the grid, the graph and the calibration."""
