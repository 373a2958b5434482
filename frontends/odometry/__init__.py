"""Wheel odometry: messages accepted in order, the path they make, its noise, and the live pose on it."""
