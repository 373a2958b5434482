"""Zenoh: sessions and their security, what is received, and what is published."""
