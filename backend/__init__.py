"""Estimation: the pose graph, the grid map, and the geometry they share. Knows no transport, file format or viewer."""
