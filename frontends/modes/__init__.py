"""What a drive does with a map: it makes one, goes on with one, or localises in one that stays as it is."""
