"""Floors of a building: when the robot has left one, and which one it is on."""
