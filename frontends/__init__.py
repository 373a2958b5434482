"""From measurements to an estimate, by factors and loop closures. Pure: it reads no clock and no files."""
