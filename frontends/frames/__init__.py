"""Frames of the robot: rigid poses in space, and the tree of fixed transforms that leads from one frame to another."""
