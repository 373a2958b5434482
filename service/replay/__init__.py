"""Recordings played: through the pipeline into a folder of results, or onto Zenoh."""
