"""WiFi: scans become fingerprints, and fingerprints propose loop candidates.

The way of one scan, with its type and where it waits:
1. `measurements.WifiScan`: as decoded. `intake.wifi_intake.WifiIntake` judges its receiver (`wifi_watch`).
2. `readings.Readings`: its usable readings. They wait in `WifiIntake` until the scan's clock is compared with the
   odometry's and the path covers its stamp.
3. `readings.PlacedWifiScan`: where on the path the scan and each reading were taken. It waits in `readings_by_place`
   until later scans have brought the readings of the same place.
4. `fingerprints.Fingerprint`: the mean of the scans of half a metre, which wait in `wifi_frontend.WifiFrontend` until
   these are driven. `fingerprint_index` finds the earlier ones that are most similar.
5. `fingerprints.WifiCandidate`: two fingerprints that may be of one place. `slam.Slam` first has the laser check it
   (`closures.lidar_closer`). Where the laser did not see both places, or leaves the candidate open, it waits in
   `WifiFrontend` until the path around the later place is driven; then it is known whether it is mutual.
6. `closures.wifi_claims.Claim`: a mutual candidate and its state. `closures.wifi_closer` judges it against the estimate
   and the other claims; an accepted one is a `backend.graph.factors.NearFactor`.
"""
