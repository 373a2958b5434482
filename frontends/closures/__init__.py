"""Loop closures: candidates from the estimate and from WiFi, checked, judged, and taken back where they prove wrong."""
