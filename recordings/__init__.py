"""What is read and written: messages, MCAP, Rerun, trajectories, maps, and simulated recordings."""
