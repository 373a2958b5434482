"""The occupancy grid: scans drawn at poses, submap by submap, and redrawn where a correction moved them."""
