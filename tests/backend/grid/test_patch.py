"""Patches and their sum: newer evidence wins, within the bounds of the sensor model."""

import math

import numpy as np
import pytest
from grids import CONFIG, drawn, drive, probability_at, room_scan

from wayfi.backend.grid.drawing import GridScan, Points, draw_patch
from wayfi.backend.grid.grid_map import SUBMAP_KEYFRAMES
from wayfi.backend.grid.patch import CellWindow
from wayfi.backend.grid.sensor_model import HIT, MAX_EVIDENCE, MAX_SCANS, MIN_EVIDENCE
from wayfi.backend.pose2 import Floats


def behind(hits: Points, pose: Floats, disc_xy_m: tuple[float, float], radius_m: float) -> Points:
    """The `hits` seen from base_link at `pose`, cut where a disc, round as a person, stands before them."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    towards = np.array([[c, s], [-s, c]]) @ (np.array(disc_xy_m) - pose[:2])
    ranges = np.hypot(hits[:, 0], hits[:, 1])
    directions = hits / ranges[:, None]
    along = directions @ towards
    inside = radius_m**2 - (towards @ towards - along**2)
    entered = along - np.sqrt(np.maximum(inside, 0.0))
    cut = (inside > 0) & (along > 0) & (entered < ranges)
    return np.where(cut[:, None], directions * entered[:, None], hits).astype(np.float32)


def test_a_person_who_walks_by_leaves_free_space_and_the_walls_behind() -> None:
    poses = np.c_[np.linspace(1.0, 2.0, 60), np.full(60, 1.0), np.full(60, 0.5)]
    person = [(1.5 + 0.05 * k, 3.5) for k in range(60)]
    scans = [behind(room_scan(pose), pose, at, 0.25) for pose, at in zip(poses, person, strict=True)]
    grid = drawn(poses, scans)
    x, y = (a.ravel() for a in np.meshgrid(np.arange(1.5, 4.5, 0.05), np.arange(3.2, 3.8, 0.05)))
    walked = probability_at(grid, x, y)
    assert walked.max() < CONFIG.occupied_probability
    assert (walked < CONFIG.free_probability).mean() > 0.95
    alone = drawn(poses, [room_scan(pose) for pose in poses])
    known = alone.evidence != 0
    sure = np.sign(grid.evidence[known]) == np.sign(alone.evidence[known])
    assert sure.mean() > 0.98


@pytest.mark.parametrize("there_first", [True, False])
def test_what_was_seen_last_wins(there_first: bool) -> None:
    poses = np.c_[np.tile(np.linspace(1.0, 2.0, 60), 2), np.full(120, 1.0), np.full(120, 0.5)]
    seen = [there_first] * 60 + [not there_first] * 60
    scans = [
        behind(room_scan(pose), pose, (4.0, 3.0), 0.4) if there else room_scan(pose)
        for pose, there in zip(poses, seen, strict=True)
    ]
    angles = np.radians(np.arange(180, 260, 2))  # its near side
    grid = drawn(poses, scans)
    side = [probability_at(grid, 4.0 + r * np.cos(angles), 3.0 + r * np.sin(angles)) for r in (0.38, 0.41, 0.44)]
    if there_first:
        assert np.max(side) < CONFIG.free_probability
    else:
        assert (np.max(side, axis=0) > CONFIG.occupied_probability).mean() > 0.95


def test_evidence_stays_within_its_bounds_and_its_type() -> None:
    scans = [room_scan(drive(1)[0])] * 600
    grid = drawn(np.repeat(drive(1), 600, axis=0), scans)
    assert (grid.evidence.min(), grid.evidence.max()) == (MIN_EVIDENCE, MAX_EVIDENCE)
    assert SUBMAP_KEYFRAMES <= MAX_SCANS
    patch = draw_patch([GridScan(scans[0])] * MAX_SCANS, np.repeat(drive(1), MAX_SCANS, axis=0), 0.05, CONFIG)
    assert patch.evidence.max() == MAX_SCANS * HIT


def test_windows() -> None:
    window = CellWindow(0, 0, 4, 6)
    assert window.intersection(CellWindow(2, -3, 9, 2)) == CellWindow(2, 0, 4, 2)
    assert window.intersection(CellWindow(5, 0, 9, 2)).shape == (0, 2)
    assert CellWindow(1, 1, 4, 6).is_within(window)
    assert not CellWindow(1, 1, 5, 6).is_within(window)
    assert CellWindow(9, 9, 9, 9).is_within(window)
