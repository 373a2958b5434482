"""What is read and written: messages, MCAP, Rerun, files of results, and simulated recordings."""
