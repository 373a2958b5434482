"""From measurements to factors: odometry, LiDAR, WiFi, and the closures they propose."""
