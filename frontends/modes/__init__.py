"""Changing what a drive does while it goes on."""
