"""Measurements on their way to a keyframe or a fingerprint: they wait here for the odometry that places them."""
