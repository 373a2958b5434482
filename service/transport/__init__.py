"""Zenoh: sessions and who may join them, what comes in, and what goes out."""
