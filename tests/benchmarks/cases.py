"""The replays to measure: real recordings, drives of our own simulator, and drives of another one.

The real recordings and the other simulator lie beside the project, in ../shared; what is simulated is made once, into
build/benchmarks.
"""

import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from wayfi.recordings.simulation.recorder import simulate
from wayfi.recordings.simulation.robots.models import Robot
from wayfi.recordings.simulation.worlds.blueprints import World

ROOT = Path(__file__).resolve().parents[2]
SHARED, MADE = ROOT.parent / "shared", ROOT / "build" / "benchmarks"
REAL, OWN, OTHER = SHARED / "data", MADE / "own_worlds", MADE / "other_worlds"
OTHER_SIMULATOR = SHARED / "tools" / "other_worlds.py"
WITHOUT_LASER = ("--set", "lidar.enabled=false")
WITHOUT_WIFI = ("--set", "wifi.enabled=false")
SEEDS = (1, 2, 3)  # of the other simulator
OWN_SEEDS = (0, 1, 2)


@dataclass(frozen=True, slots=True)
class OwnWorld:
    """A drive of our own simulator: one of its worlds and robots."""

    world: World
    robot: Robot
    seed: int

    @property
    def folder(self) -> Path:
        """Where it is made."""
        return OWN / f"{self.world}_{self.robot}_{self.seed}"

    def make(self, folder: Path) -> None:
        """Simulate it into `folder`."""
        simulate(self.world, folder, seed=self.seed, robot=self.robot)


@dataclass(frozen=True, slots=True)
class OtherWorld:
    """A drive of the other simulator: one of its worlds, with its own options."""

    world: str
    options: tuple[str, ...]
    seed: int

    @property
    def folder(self) -> Path:
        """Where it is made."""
        return OTHER / "_".join([self.world, *(option.strip("-") for option in self.options), str(self.seed)])

    def make(self, folder: Path) -> None:
        """Simulate it into `folder`. Raises CalledProcessError."""
        command = [sys.executable, OTHER_SIMULATOR, self.world, folder, "--seed", str(self.seed), "--no-log"]
        subprocess.run([*command, *self.options], check=True, stdout=subprocess.DEVNULL)


@dataclass(frozen=True, slots=True)
class Case:
    """A replay to measure: the folder with recording.mcap and its references, and options of `wayfi replay`.

    `simulated` says how the recording is made, if it is. One that is `taught` starts with the calibration that another
    recording has left. Of one that is `pictured` the map is kept, for it has no reference of its own or a poor one.
    """

    name: str
    folder: Path
    options: tuple[str, ...] = ()
    simulated: OwnWorld | OtherWorld | None = None
    taught: Path | None = None
    pictured: bool = False

    @property
    def title(self) -> str:
        """The name, with the seed where there are several."""
        return f"{self.name}, seed {self.simulated.seed}" if self.simulated else self.name

    @property
    def recording(self) -> Path:
        """The recording."""
        return self.folder / "recording.mcap"

    @property
    def settings(self) -> tuple[str, ...]:
        """The settings among the options."""
        return self.options[1::2]


def real(name: str, *options: str, pictured: bool = False) -> Case:
    """A recording of ../shared/data."""
    return Case(name, REAL / name, options, pictured=pictured)


def own(world: World, robot: Robot, without: str = "", *options: str) -> list[Case]:
    """Drives of our own simulator, one of each seed."""
    drives = [OwnWorld(world, robot, seed) for seed in OWN_SEEDS]
    name = ", ".join(part for part in (f"simulated {world}", robot, without) if part)
    return [Case(name, drive.folder, options, drive) for drive in drives]


def others(world: str, name: str, options: tuple[str, ...], *replay: str) -> list[Case]:
    """Drives of the other simulator, one of each seed."""
    drives = [OtherWorld(world, options, seed) for seed in SEEDS]
    return [Case(f"{name} (other simulator)", drive.folder, replay, drive) for drive in drives]


CASES = [
    real("b14test1"),
    real("b24test2"),
    real("b3test2"),
    Case("b24test2, calibrated on b14test1", REAL / "b24test2", taught=REAL / "b14test1"),
    Case("b3test2, calibrated on b14test1", REAL / "b3test2", taught=REAL / "b14test1"),
    real("ilc_site1F1"),
    real("flat_calib3"),
    real("intel"),
    Case("intel_wifi (its WiFi is simulated)", REAL / "intel_wifi"),
    Case("intel_wifi (its WiFi is simulated), laser off", REAL / "intel_wifi", WITHOUT_LASER),
    Case("killian_part (its wheels and WiFi are simulated)", REAL / "killian_part"),
    real("fr079_raw", pictured=True),
    real("fr101"),
    real("belgioioso"),
    real("seattle"),
    real("wean2", pictured=True),
    real("okazaki_dec13", pictured=True),
    real("okazaki_feb13", pictured=True),
    real("mines_exp1", pictured=True),
    real("tb4_mac2", pictured=True),
    real("leg_three_lasers", "--set", "recording.scan=/rear_scan", pictured=True),
    *others("garage", "garage --rough", ("--rough",)),
    *others("office", "office --rough", ("--rough",)),
    *others("warehouse", "warehouse --rough", ("--rough",)),
    *others("garage", "garage, ideal laser", ()),
    *others("garage", "garage without laser", (), *WITHOUT_LASER),
    *others("office", "office without laser", (), *WITHOUT_LASER),
    *[case for robot in (Robot.TYPICAL, Robot.CHEAP) for world in World for case in own(world, robot)],
    *[case for world in World for case in own(world, Robot.TYPICAL, "WiFi off", *WITHOUT_WIFI)],
    *own(World.CARPARK, Robot.TYPICAL, "laser off", *WITHOUT_LASER),
    *own(World.OFFICE, Robot.TYPICAL, "laser off", *WITHOUT_LASER),
    *own(World.CARPARK, Robot.IDEAL),
]


def chosen(only: list[str]) -> Iterator[Case]:
    """The cases whose name has one of `only` in it, or all; without those whose files or simulator are not here."""
    for case in CASES:
        if only and not any(word in case.title for word in only):
            continue
        needed = OTHER_SIMULATOR if isinstance(case.simulated, OtherWorld) else case.folder
        if not isinstance(case.simulated, OwnWorld) and not needed.exists():
            sys.stderr.write(f"{case.title}: left out, there is no {needed}\n")
            continue
        yield case


def make(case: Case) -> None:
    """Simulate the recording of a case, if it is a simulated one and has none yet."""
    if case.simulated is None or case.folder.exists():
        return
    unfinished = case.folder.with_suffix(".part")
    unfinished.parent.mkdir(parents=True, exist_ok=True)
    case.simulated.make(unfinished)
    unfinished.rename(case.folder)
