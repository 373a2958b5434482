"""The folder of a run: the black box of what the estimation was fed, and its checkpoints."""
