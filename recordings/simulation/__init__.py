"""Simulated recordings: worlds, a robot that drives through them, and its sensors."""
