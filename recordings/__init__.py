"""Input and output: messages, MCAP files, the Rerun log, result files, and simulated recordings."""
