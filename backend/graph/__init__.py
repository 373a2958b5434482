"""The pose graph: its factors, their form in gtsam, iSAM2 over them, and the health of the estimate."""
