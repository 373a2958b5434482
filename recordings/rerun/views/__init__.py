"""What the Rerun log shows, one view a file."""
