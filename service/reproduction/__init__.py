"""The method that wayfi starts from, as its paper has it (Ismail et al., arXiv 2206.08733), and the paper's tables."""
