"""Planar LiDAR: points and normals of a scan, scan matching, and the watch over the laser and its clock."""
