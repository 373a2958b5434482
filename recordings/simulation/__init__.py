"""Simulated recordings: worlds, the robot that drives through them, and what its sensors say."""
