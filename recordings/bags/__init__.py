"""Recordings of every kind as one stream of records: MCAP, rosbag2 databases, ROS 1 bags and CARMEN logs."""
