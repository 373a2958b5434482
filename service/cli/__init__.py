"""The command line: one function a command, and what it says."""
