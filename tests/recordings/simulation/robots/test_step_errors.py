"""What floor and a wandering bias add to the steps of the odometry."""

import numpy as np

from wayfi.recordings.simulation.robots.bias_walk import wandering_bias
from wayfi.recordings.simulation.robots.ground import scales_of_the_ground
from wayfi.recordings.simulation.wheels import WheelErrors

WALK = 1e-4
WHEELS = WheelErrors(1.0, 1.0, 0.0, 0.0, bias_walk=WALK)


def test_the_bias_spreads_with_the_root_of_time_however_often_it_is_stepped() -> None:
    for period_s in (0.1, 0.5):
        steps = round(1000 / period_s)
        rates = [
            wandering_bias(steps, period_s, WHEELS, np.random.default_rng(seed)).turn_rad[-1] / period_s
            for seed in range(300)
        ]
        assert 0.85 < np.std(rates) / (WALK * np.sqrt(1000)) < 1.15


def test_a_longer_walk_begins_like_the_shorter() -> None:
    short, long = (wandering_bias(steps, 0.1, WHEELS, np.random.default_rng(1)).turn_rad for steps in (50, 90))
    np.testing.assert_array_equal(short, long[:50])


def test_the_floor_is_the_same_at_every_visit_and_differs_from_place_to_place() -> None:
    out = np.column_stack([np.linspace(0.0, 200.0, 2001), np.zeros(2001), np.zeros(2001)])
    floor = scales_of_the_ground(np.vstack([out, out[::-1]]), np.random.default_rng(0))
    np.testing.assert_allclose(floor.distance_scale[1:2001], floor.distance_scale[:2000:-1])
    for scale, rms in ((floor.distance_scale, 0.005), (floor.turn_scale, 0.01)):
        assert 0.4 * rms < (scale - 1).std() < 1.6 * rms
    assert np.abs(np.diff(floor.distance_scale)).max() < 1e-3
