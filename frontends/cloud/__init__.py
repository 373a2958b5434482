"""3D LiDAR: the height band of a cloud, and its registration by KISS-ICP."""
