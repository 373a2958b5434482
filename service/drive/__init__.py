"""One drive from its bytes to its files, the same for the replay and the daemon."""
