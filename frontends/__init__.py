"""From measurements to an estimate: what the sensors say becomes factors and closures. Pure: no clock, no files."""
