"""What lasers send, made usable: bearings, units and times that cannot be right, and turns that come in fragments."""
