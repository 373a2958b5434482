"""3D LiDAR: the height band of a cloud, and its matching by KISS-ICP."""
