"""Maps of a building: what of a drive outlives it, and what is done with such a map."""
