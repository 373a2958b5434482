"""The experiments: which map, which drive, where the robot is switched on, and what it has."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from benchmarks.localization.drives import Drive, records, simulated, stream
from benchmarks.localization.maps import KnownMap, map_of
from benchmarks.localization.running import MakeLocalizer, run
from benchmarks.localization.scoring import BY_LASER, BY_WIFI, Bounds, Run, Score, score

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.measurements import SECOND_NS, Sensor
from wayfi.frontends.slam_config import SlamConfig
from wayfi.recordings.trajectory import Trajectory

RUN_S = 60.0
LASER = (Sensor.SCAN, Sensor.POINTS)


@dataclass(frozen=True, slots=True)
class Result:
    """One run of an experiment, by name, with its score."""

    name: str
    run: Run
    score: Score
    truth: Trajectory
    known: KnownMap
    bounds: Bounds = BY_LASER


@dataclass(frozen=True, slots=True)
class Experiment:
    """Runs from random starts in `drive`, in the map of `mapped`; both are made when they are first asked for.

    `left_out` are the sensors that the robot does not have. Of an experiment `elsewhere` the map is of another
    building: any claim is false. Starts are `after` this share of the drive.
    """

    name: str
    mapped: Callable[[Path], KnownMap]
    drive: Callable[[Path], Drive]
    left_out: tuple[Sensor, ...] = ()
    bounds: Bounds = BY_LASER
    elsewhere: bool = False
    after: float = 0.0
    run_s: float = RUN_S

    def config(self) -> SlamConfig:
        """The settings, with the sensors switched off that the robot does not have."""
        config = SlamConfig()
        if Sensor.SCAN in self.left_out:
            config = replace(config, lidar=replace(config.lidar, enabled=False))
        if Sensor.WIFI in self.left_out:
            config = replace(config, wifi=replace(config.wifi, enabled=False))
        return config

    def starts_ns(self, drive: Drive, count: int, seed: int) -> list[int]:
        """`count` random moments, the same for the same `seed`."""
        first, last = int(drive.truth.stamps_ns[0]), int(drive.truth.stamps_ns[-1])
        first += round(self.after * (last - first))
        return sorted(np.random.default_rng(seed).integers(first, last - round(self.run_s * SECOND_NS), count).tolist())

    def results(self, kept: Path, make: MakeLocalizer, count: int, seed: int = 0) -> Iterator[Result]:
        """Run and score `count` starts."""
        known, drive = self.mapped(kept), self.drive(kept)
        T_truth_map = known.T_truth_map if not self.elsewhere else FAR_AWAY
        for number, start_ns in enumerate(self.starts_ns(drive, count, seed)):
            end_ns = start_ns + round(self.run_s * SECOND_NS)
            measurements = stream(records(drive.recording), start_ns, end_ns, self.left_out)
            done = run(make(known.building, self.config()), measurements, start_ns, end_ns)
            scored = score(done, drive.truth, T_truth_map, self.bounds)
            yield Result(f"{self.name} #{number}", done, scored, drive.truth, known, self.bounds)


FAR_AWAY = Pose2(1e6, 1e6, 0.0)  # of a map of another building: every claim in it is false


def simulated_map(world: str, seed: int, *options: str) -> tuple[Callable[[Path], KnownMap], Callable[[Path], Drive]]:
    """The map of the first day of a simulated building, and the drive of another day in it."""
    return (
        lambda kept: map_of(kept, simulated(kept, world, seed, 0, *options)),
        lambda kept: simulated(kept, world, seed, 2, *options),
    )


def another_day(world: str, seed: int, *options: str, without: Sequence[Sensor] = ()) -> Experiment:
    """Another day in the building of a map, `without` some sensors."""
    title = ", ".join([world, *(o.strip("-") for o in options), f"seed {seed}", *_left_out_words(without)])
    bounds = BY_WIFI if Sensor.SCAN in without else BY_LASER
    return Experiment(title, *simulated_map(world, seed, *options), tuple(without), bounds)


def other_building(world: str, seed: int, other_world: str, other_seed: int) -> Experiment:
    """A drive through `other_world` of `other_seed` with the map of `world`."""
    name = f"map of {world} {seed}, start in {other_world} {other_seed}"
    mapped, drive = simulated_map(world, seed)[0], simulated_map(other_world, other_seed)[1]
    return Experiment(name, mapped, drive, elsewhere=True)


def second_half(name: str, drive: Drive, without: Sequence[Sensor] = ()) -> Experiment:
    """Starts in the second half of a recording, with the map of its first half."""
    title = ", ".join([f"{name}, second half", *_left_out_words(without)])
    bounds = BY_WIFI if Sensor.SCAN in without else BY_LASER
    return Experiment(
        title, lambda kept: map_of(kept, drive, middle_ns(drive)), lambda _: drive, tuple(without), bounds, after=0.5
    )


def middle_ns(drive: Drive) -> int:
    """The stamp half way through a drive."""
    return int(drive.truth.stamps_ns[0] + drive.truth.stamps_ns[-1]) // 2


def _left_out_words(without: Sequence[Sensor]) -> list[str]:
    words = {Sensor.SCAN: "no laser", Sensor.WIFI: "no WiFi"}
    return [words[sensor] for sensor in without if sensor in words]
