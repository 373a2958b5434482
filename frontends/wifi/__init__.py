"""WiFi: scans become fingerprints, and fingerprints propose loop candidates.

The way of one scan, with its type and where it waits:
1. `measurements.WifiScan`: as decoded. `intake.wifi_intake` checks its readings, has `wifi_watch` judge its receiver,
   and holds it until the odometry covers its stamp.
2. `readings.PlacedWifiScan`: where on the path the scan and each reading were taken. `readings_by_place` holds it until
   later scans have brought the readings that were taken there.
3. `fingerprints.Fingerprint`: the mean of the scans of half a metre, placed in a keyframe's frame; `wifi_frontend`
   gathers them, and `fingerprint_index` finds the earlier ones that are most similar.
4. `fingerprints.WifiCandidate`: two fingerprints of one place, held until the path around the later one is driven.
5. `closures.wifi_claims.Claim`: a mutual candidate and its state. `closures.wifi_closer` judges it against the estimate
   and the other claims; an accepted one is a `backend.graph.factors.NearFactor`.
"""
