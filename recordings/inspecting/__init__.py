"""What an inspection finds out about each kind of stream: its clock, odometry, lasers, WiFi and frames."""
