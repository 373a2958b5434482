"""The Rerun log: its stream, its blueprint, the process that draws it, and the viewer."""
