"""The command line: one function a command, and the summaries that they print."""
