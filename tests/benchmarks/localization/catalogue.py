"""All experiments. Settings are chosen on the first seeds alone; the others are for confirming them."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Protocol

from benchmarks.localization.changes import access_points_moved, all_access_points_replaced, another_mount
from benchmarks.localization.drives import SHARED, Drive
from benchmarks.localization.experiments import (
    LASER,
    Result,
    WholeHalf,
    another_day,
    changed_day,
    other_building,
    second_half,
)
from benchmarks.localization.kidnapping import kidnapping
from benchmarks.localization.running import MakeLocalizer

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.measurements import Sensor

WORLDS = ("garage", "office", "warehouse")
SEEDS = (31, 32)
ROUGH_SEEDS = (33,)
WIFI = (Sensor.WIFI,)
REAL = SHARED / "data"
OTHER_MOUNT = Pose2(-0.2, 0.1, 0.4)


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
    yield from _real()
    yield from _changed()


def _real() -> Iterator[Measurable]:
    """Real recordings of which the second half comes by where the first was."""
    b14, intel = second_half("b14test1", Drive(REAL / "b14test1"), *LASER), Drive(REAL / "intel_wifi")
    yield b14
    yield WholeHalf(f"{b14.name}, in one run", b14)
    yield second_half("intel_wifi", intel)
    yield WholeHalf("intel_wifi, second half, in one run", second_half("intel_wifi", intel))
    yield second_half("intel_wifi", intel, *LASER)
    yield second_half("intel", Drive(REAL / "intel"))
    yield second_half("seattle", Drive(REAL / "seattle"))
    yield second_half("flat_calib3", Drive(REAL / "flat_calib3"))
    yield second_half("killian_part", Drive(REAL / "killian_part"))


def _changed() -> Iterator[Measurable]:
    for world in WORLDS:
        yield changed_day(world, 32, "every access point replaced", all_access_points_replaced)
        yield changed_day(world, 32, "30 % of the access points moved", access_points_moved(0.3))
        yield changed_day(world, 32, "another laser's mount", another_mount(OTHER_MOUNT), OTHER_MOUNT)
        yield another_day(world, 34, "--hard-wifi")


def chosen(only: Sequence[str], exact: Sequence[str] = ()) -> Iterator[Measurable]:
    """The experiments with all of `only` in their names; of these the ones named in `exact`, if there are any."""
    return (e for e in _experiments() if all(word in e.name for word in only) and (not exact or e.name in exact))
