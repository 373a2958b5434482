"""The pose graph: its factors, their form in gtsam, iSAM2 over them, and what the estimate is worth."""
