"""All experiments. Settings are chosen on the first seeds alone; the others are for confirming them."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Protocol

from benchmarks.localization.drives import SHARED, Drive
from benchmarks.localization.experiments import LASER, Result, another_day, other_building, second_half
from benchmarks.localization.kidnapping import kidnapping
from benchmarks.localization.running import MakeLocalizer

from wayfi.frontends.measurements import Sensor

WORLDS = ("garage", "office", "warehouse")
SEEDS = (31, 32)
ROUGH_SEEDS = (33,)
WIFI = (Sensor.WIFI,)
REAL = SHARED / "data"


class Measurable(Protocol):
    """An experiment by name."""

    name: str

    def results(self, kept: Path, make: MakeLocalizer, count: int, seed: int = 0) -> Iterator[Result]:
        """Run and score `count` starts."""


def _experiments() -> Iterator[Measurable]:
    pairs = [(world, seed) for seed in SEEDS for world in WORLDS]
    yield from (another_day(world, seed) for world, seed in pairs)
    yield from (another_day(world, seed, "--rough") for seed in ROUGH_SEEDS for world in WORLDS)
    yield from (another_day(world, seed, without=LASER) for world, seed in pairs)
    yield from (another_day(world, seed, without=WIFI) for world, seed in pairs)
    yield from (other_building(world, 31, world, 32) for world in WORLDS)
    yield from (other_building(a, 31, b, 31) for a, b in zip(WORLDS, WORLDS[1:] + WORLDS[:1], strict=True))
    yield from (kidnapping(world, seed) for world, seed in pairs)
    yield second_half("b14test1", Drive(REAL / "b14test1"), LASER)
    yield second_half("intel_wifi", Drive(REAL / "intel_wifi"))


def chosen(only: Sequence[str]) -> Iterator[Measurable]:
    """The experiments with all of `only` in their names."""
    return (e for e in _experiments() if all(word in e.name for word in only))
