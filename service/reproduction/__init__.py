"""The batch method of Ismail et al. (arXiv 2206.08733), from which wayfi started, and the paper's tables."""
