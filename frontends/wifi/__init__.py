"""WiFi: scans become fingerprints, and fingerprints propose loop candidates."""
