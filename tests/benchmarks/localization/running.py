"""Runs of localisation in this process: a stream of measurements through a localizer, scored afterwards."""

import time
from collections.abc import Callable, Iterable
from typing import Protocol

from benchmarks.localization.scoring import Change, Claim, Run, claims_and_changes

from wayfi.frontends.events import Event
from wayfi.frontends.maps.building_map import BuildingMap
from wayfi.frontends.measurements import Measurement, StaticTransforms
from wayfi.frontends.slam_config import SlamConfig


class Localizer(Protocol):
    """What is measured: it takes measurements in their order, and publishes poses in the map's frame."""

    def process(self, measurement: Measurement) -> list[Event]:
        """Process the next measurement; returns the events that follow from it."""


MakeLocalizer = Callable[[BuildingMap, SlamConfig], Localizer]


def run(localizer: Localizer, measurements: Iterable[Measurement], start_ns: int, end_ns: int) -> Run:
    """Feed `measurements` to a localizer; the first message is timed as well."""
    claims: list[Claim] = []
    changes: list[Change] = []
    cpu_s, longest_s, newest_ns = 0.0, 0.0, start_ns
    for measurement in measurements:
        before_s = time.process_time()
        events = localizer.process(measurement)
        took_s = time.process_time() - before_s
        cpu_s, longest_s = cpu_s + took_s, max(longest_s, took_s)
        newest_ns = max(newest_ns, 0 if isinstance(measurement, StaticTransforms) else measurement.stamp_ns)
        claimed, changed = claims_and_changes(events, newest_ns)
        claims += claimed
        changes += changed
    return Run(start_ns, end_ns, claims, changes, round(cpu_s, 3), round(1e3 * longest_s, 1))
