"""WiFi: scans become fingerprints, and fingerprints propose loop candidates.

The way of one scan, with the type that it has and where it waits:
1. `measurements.WifiScan`: as decoded. `intake.wifi_intake` checks its readings and holds it until the odometry covers
   its stamp.
2. `readings.PlacedWifiScan`: where on the path the scan and each reading were taken. `readings_by_place` holds it until
   the older readings of later scans have come.
3. `fingerprints.Fingerprint`: the mean of the scans of half a metre, placed in a keyframe's frame; `wifi_frontend`
   gathers them, and `fingerprint_index` finds the earlier ones that are most similar.
4. `fingerprints.WifiCandidate`: two fingerprints of one place, held until the path around the later one is driven.
5. `closures.wifi_closer` judges it against the estimate and the other candidates; an accepted one is a
   `backend.graph.factors.NearFactor`.
"""
