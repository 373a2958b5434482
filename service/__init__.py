"""The program: the command line, the replay and the daemon."""
