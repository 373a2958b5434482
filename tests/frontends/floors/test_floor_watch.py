"""Whether the robot has changed floors: cabins, and what WiFi says of them."""

import numpy as np
import pytest

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.floors.floor_config import FloorConfig
from wayfi.frontends.floors.floor_watch import FloorWatch, is_cabin, similarity
from wayfi.frontends.scan_points import ScanPoints
from wayfi.frontends.wifi.readings import Readings, mean_rssi

CONFIG = FloorConfig()
SIGMA_DB = 6.0


def room(side_m: float) -> ScanPoints:
    along = np.linspace(-side_m / 2, side_m / 2, 40)
    edge = np.full(40, side_m / 2)
    points = np.concatenate(
        [np.column_stack(p) for p in ((along, edge), (along, -edge), (edge, along), (-edge, along))]
    )
    return ScanPoints(points, np.zeros_like(points), Pose2())


def heard(floor: int, below_db: float = 0.0) -> Readings:
    return mean_rssi({f"02:00:00:00:{floor:02x}:{n:02x}": [-40.0 - n - below_db] for n in range(20)})


def driven() -> FloorWatch:
    """A watch that knows how alike two scans of one place are."""
    watch = FloorWatch(CONFIG, SIGMA_DB)
    for n in range(5):
        assert not watch.hear("phone", 0.4 * n, heard(0))
    return watch


def test_a_cabin_is_small_all_around() -> None:
    assert is_cabin(room(2.2), CONFIG)
    assert not is_cabin(room(6.0), CONFIG)
    assert not is_cabin(ScanPoints(np.zeros((3, 2)), np.zeros((3, 2)), Pose2()), CONFIG)


@pytest.mark.parametrize(("known", "floor"), [([], 1), ([(1, heard(7))], 1), ([(1, heard(7)), (4, heard(8))], 1)])
def test_a_scan_after_a_cabin_tells_the_floor(known: list[tuple[int, Readings]], floor: int) -> None:
    watch = driven()
    watch.see(room(2.2), 1.7)
    assert not watch.doubtful
    assert not watch.hear("phone", 1.8, heard(0, below_db=15.0))
    assert watch.doubtful
    assert not watch.hear("phone", 2.1, heard(7, below_db=15.0))
    assert watch.hear("phone", 3.2, heard(7))
    assert watch.floor_of(heard(7), [(0, heard(0)), *known], present=0, newest=0) == floor
    assert not watch.doubtful


def test_a_closet_on_the_same_floor_changes_nothing() -> None:
    watch = driven()
    watch.see(room(2.2), 1.7)
    assert not watch.hear("phone", 1.8, heard(0, below_db=15.0))
    assert watch.hear("phone", 3.5, heard(0, below_db=3.0))
    assert watch.floor_of(heard(0, below_db=3.0), [(0, heard(0))], present=0, newest=3) == 0


def test_without_a_laser_no_floor_is_told() -> None:
    watch = driven()
    assert not watch.hear("phone", 1.7, heard(5))
    assert not watch.doubtful


def test_with_a_laser_that_sees_no_cabin_a_change_is_none_of_the_floor() -> None:
    watch = driven()
    watch.see(room(6.0), 1.6)
    assert not watch.hear("phone", 1.7, heard(5))
    assert not watch.doubtful


def test_a_small_room_where_wifi_stays_as_it_is_begins_no_doubt() -> None:
    watch = driven()
    watch.see(room(2.2), 1.7)
    assert not watch.hear("phone", 1.8, heard(0, below_db=3.0))
    assert not watch.doubtful


def test_without_wifi_the_doubt_ends() -> None:
    watch = driven()
    watch.see(room(2.2), 1.7)
    watch.hear("phone", 1.8, heard(0, below_db=15.0))
    assert watch.doubtful
    watch.drive(1.8 + CONFIG.silent_m - 1.0)
    assert watch.doubtful
    watch.drive(1.8 + CONFIG.silent_m + 1.0)
    assert not watch.doubtful


def test_similarity_is_one_of_itself_and_falls_with_the_levels() -> None:
    assert similarity(heard(0), heard(0), SIGMA_DB) == pytest.approx(1.0)
    assert similarity(heard(0), heard(1), SIGMA_DB) == 0.0
    assert similarity(heard(0), heard(0, below_db=6.0), SIGMA_DB) == pytest.approx(np.exp(-0.5))
    assert similarity(mean_rssi({}), mean_rssi({}), SIGMA_DB) == 0.0
