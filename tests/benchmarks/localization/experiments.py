"""The experiments: which map, which drive, where the robot is switched on, and what it has."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from benchmarks.localization.changes import Change, all_access_points_replaced, unchanged
from benchmarks.localization.drives import Drive, records, simulated, stream
from benchmarks.localization.maps import KnownMap, before, map_of
from benchmarks.localization.running import MakeLocalizer, run
from benchmarks.localization.scoring import BY_LASER, BY_WIFI, Bounds, Run, Score, score
from numpy.typing import NDArray

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.measurements import SECOND_NS, Sensor
from wayfi.frontends.slam_config import SlamConfig
from wayfi.recordings.trajectory import Trajectory

RUN_S = 60.0
NEAR_M, NEAR_FOR_S = 3.0, (0.0, 10.0)  # of the map: where the robot can be expected to find it
MOST_TRIED = 10_000
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
    building: any claim is false. A robot `changed` measures something else. Of a drive by halves, the map is of the
    first half and the starts are in the second, where the robot is near the map.
    """

    name: str
    mapped: Callable[[Path], KnownMap]
    drive: Callable[[Path], Drive]
    left_out: tuple[Sensor, ...] = ()
    bounds: Bounds = BY_LASER
    elsewhere: bool = False
    by_halves: bool = False
    changed: Change = unchanged
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
        first = middle_ns(drive) if self.by_halves else int(drive.truth.stamps_ns[0])
        last = int(drive.truth.stamps_ns[-1]) - round(self.run_s * SECOND_NS)
        moments = np.random.default_rng(seed).integers(first, last, MOST_TRIED)
        if self.by_halves:
            moments = moments[_near_first_half(drive, moments)]
        return sorted(moments[:count].tolist())

    def results(self, kept: Path, make: MakeLocalizer, count: int, seed: int = 0) -> Iterator[Result]:
        """Run and score `count` starts."""
        known, drive = self.mapped(kept), self.drive(kept)
        for number, start_ns in enumerate(self.starts_ns(drive, count, seed)):
            yield self.result(
                f"{self.name} #{number}", known, drive, start_ns, start_ns + round(self.run_s * SECOND_NS), make
            )

    def result(
        self, name: str, known: KnownMap, drive: Drive, start_ns: int, end_ns: int, make: MakeLocalizer
    ) -> Result:
        """Run and score one start."""
        T_truth_map = FAR_AWAY if self.elsewhere else known.T_truth_map
        measured = stream(records(drive.recording), start_ns, end_ns, self.left_out)
        measurements = self.changed(measured, known.bssids)
        done = run(make(known.building, self.config()), measurements, start_ns, end_ns)
        return Result(name, done, score(done, drive.truth, T_truth_map, self.bounds), drive.truth, known, self.bounds)


@dataclass(frozen=True, slots=True)
class WholeHalf:
    """One run through all of the second half of a drive, in the map of the first."""

    name: str
    starts: Experiment

    def results(self, kept: Path, make: MakeLocalizer, count: int, seed: int = 0) -> Iterator[Result]:  # noqa: ARG002
        """Run and score it."""
        known, drive = self.starts.mapped(kept), self.starts.drive(kept)
        end_ns = int(drive.truth.stamps_ns[-1])
        yield self.starts.result(f"{self.name} #0", known, drive, middle_ns(drive), end_ns, make)


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


def changed_day(world: str, seed: int, what: str, change: Change, T_old_base: Pose2 | None = None) -> Experiment:
    """Another day on which something is not as it was; of another robot, `T_old_base` is its base in the old one."""
    mapped, drive = simulated_map(world, seed)
    driven = drive if T_old_base is None else (lambda kept: drive(kept).seen_from(T_old_base))
    return Experiment(f"{world}, seed {seed}, {what}", mapped, driven, changed=change)


def other_building(world: str, seed: int, other_world: str, other_seed: int) -> Experiment:
    """A drive through `other_world` of `other_seed` with the map of `world`.

    The simulator numbers its access points in every building alike; no two real ones have the same address.
    """
    name = f"map of {world} {seed}, start in {other_world} {other_seed}"
    mapped, drive = simulated_map(world, seed)[0], simulated_map(other_world, other_seed)[1]
    return Experiment(name, mapped, drive, elsewhere=True, changed=all_access_points_replaced)


def second_half(name: str, drive: Drive, *without: Sensor) -> Experiment:
    """Starts in the second half of a recording, with the map of its first half."""
    title = ", ".join([f"{name}, second half", *_left_out_words(without)])
    bounds = BY_WIFI if Sensor.SCAN in without else BY_LASER
    return Experiment(
        title, lambda kept: map_of(kept, drive, middle_ns(drive)), lambda _: drive, without, bounds, by_halves=True
    )


def middle_ns(drive: Drive) -> int:
    """The stamp half way through a drive."""
    return int(drive.truth.stamps_ns[0] + drive.truth.stamps_ns[-1]) // 2


def _near_first_half(drive: Drive, moments: NDArray[np.int64]) -> NDArray[np.bool_]:
    """(n,) whether the robot is near the way of the first half at each of `moments` (n,), and some seconds later."""
    mapped = before(drive.truth, middle_ns(drive)).poses[:, :2]
    near = np.ones(len(moments), bool)
    for after_s in NEAR_FOR_S:
        xy = drive.truth.at(moments + round(after_s * SECOND_NS))[:, :2]
        near &= np.array([np.hypot(*(mapped - each).T).min() < NEAR_M for each in xy])
    return near


def _left_out_words(without: Sequence[Sensor]) -> list[str]:
    words = {Sensor.SCAN: "no laser", Sensor.WIFI: "no WiFi"}
    return [words[sensor] for sensor in without if sensor in words]
