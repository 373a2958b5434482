"""Scores of a replay against a reference: trajectory errors, closures, covariances; and plots."""
