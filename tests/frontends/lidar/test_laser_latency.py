"""The latency of a laser's driver is found beside wheels that nobody calibrated, and only where there is one."""

import numpy as np
import pytest

from wayfi.frontends.lidar.laser_latency import Turn, latency_s
from wayfi.frontends.lidar.lidar_config import LatencyConfig

OFFSETS_S = 0.1 * np.arange(-30, 31)
CONFIG = LatencyConfig()


def turns(late_s: float, count: int = 60, failed: float = 0.0, seed: int = 0) -> list[Turn]:
    """Turns of a robot that speeds up and slows down as it turns; a share of the matches `failed`."""
    rng = np.random.default_rng(seed)
    made = []
    for _ in range(count):
        rate, change, path_m = rng.uniform(-0.8, 0.8), rng.uniform(-0.8, 0.8), rng.uniform(0.1, 0.6)
        by_wheels = rate + change * OFFSETS_S
        true = rate - change * late_s
        by_laser = 1.08 * true + 0.02 * path_m + rng.normal(0.0, 0.01)
        made.append(Turn(by_laser + (rng.uniform(-1.0, 1.0) if rng.random() < failed else 0.0), by_wheels, path_m))
    return made


@pytest.mark.parametrize("late_s", [-0.25, 0.1, 0.14, 0.25])
@pytest.mark.parametrize("failed", [0.0, 0.1])
def test_a_latency_is_found_beside_poor_wheels_and_failed_matches(late_s: float, failed: float) -> None:
    found = latency_s(turns(late_s, failed=failed), OFFSETS_S, CONFIG)
    assert found == pytest.approx(-late_s, abs=0.03)


@pytest.mark.parametrize("seed", range(10))
def test_a_driver_that_stamps_in_time_is_left_alone(seed: int) -> None:
    assert latency_s(turns(0.0, seed=seed), OFFSETS_S, CONFIG) is None


def test_a_few_turns_are_no_evidence_and_a_larger_offset_is_no_latency() -> None:
    assert latency_s(turns(0.14, count=CONFIG.min_turns - 1), OFFSETS_S, CONFIG) is None
    assert latency_s(turns(0.8), OFFSETS_S, CONFIG) is None
