"""The Rerun log: its stream, its blueprint, the process that writes it, and the viewer."""
