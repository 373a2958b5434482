"""The program: the pipeline, the command line, the replay and the daemon."""
