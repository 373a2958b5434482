"""Measurements before they become keyframes or fingerprints: checked, and held until odometry gives them a place."""
