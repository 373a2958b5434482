"""A replay against a reference: trajectory errors, closures, covariances, plots."""
