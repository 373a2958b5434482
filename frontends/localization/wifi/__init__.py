"""What WiFi says of the place in a known map.

The way of one scan: `likelihood` compares it with each place of the map (`radio_places`: the fingerprints of a square
metre). `particles` holds the poses that the robot may have: the wheels move them, the scan weighs them, and some begin
anew where it fits (`seeds`). `clusters` gathers them to places with covariances, which `WifiBelief` returns. How much a
scan counts between places is learnt from the map's own (`sharpness`).
"""
