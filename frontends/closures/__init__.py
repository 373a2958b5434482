"""Loop closures: candidates from the estimate and from WiFi, checked, judged, and removed where they prove wrong."""
