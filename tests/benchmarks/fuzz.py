"""A million mutated messages into drives: exceptions, what was dropped and why, the slowest, and memory over time.

    python tests/benchmarks/fuzz.py [--messages 1000000] [--seed 0]

Three drives share the messages, each in a process of its own: wheels with a laser, wheels with a 3D LiDAR, a laser
alone. Exit code 1 where a message raised, a pose was not finite or not later than the one before, or memory grew by
more than the drive's own growth and `SLACK_MB`.
"""

import argparse
import multiprocessing
import sys
import time
import traceback
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "helpers"))
from drives import simulated
from faulty.fuzzed_drive import Fed, as_cloud, fuzzed, thinned

from wayfi.frontends.events import Event, FingerprintAdded, KeyframeAdded, PosePublished
from wayfi.frontends.measurements import LaserScan, Measurement, Odometry
from wayfi.recordings.log import NullLog
from wayfi.recordings.simulation.worlds.blueprints import World
from wayfi.service.config import load_config
from wayfi.service.drive.drive import Drive

KINDS = ("scans", "clouds", "laser alone")
SLACK_MB = 64.0
KEPT_KB = {PosePublished: 0.1, KeyframeAdded: 100.0, FingerprintAdded: 20.0}  # what a drive keeps of each, at most
SHOWN_TIMES = 10
SLOW_S = 0.05


@dataclass
class Outcome:
    """What came of one drive."""

    kind: str
    mutated: int = 0
    sound: int = 0
    seconds: float = 0.0
    errors: Counter[str] = field(default_factory=Counter)
    slow: list[tuple[int, str]] = field(default_factory=list)
    kept: Counter[str] = field(default_factory=Counter)
    rss_mb: list[float] = field(default_factory=list)
    explained_mb: list[float] = field(default_factory=list)
    dropped: dict[str, dict[str, int]] = field(default_factory=dict)
    warnings: int = 0
    last_ns: int = -1

    def take(self, event: Event) -> None:
        """Count an event; a pose has to be finite, and later than the one before."""
        self.kept[type(event).__name__] += 1
        if isinstance(event, PosePublished):
            if not event.T_map_base.is_finite():
                self.errors["a pose that is not finite"] += 1
            if event.stamp_ns <= self.last_ns:
                self.errors["a pose that is not later than the one before"] += 1
            self.last_ns = event.stamp_ns

    def measure(self) -> None:
        """Note the memory of now, and how much of it the drive may keep."""
        self.rss_mb.append(rss_mb())
        self.explained_mb.append(sum(kb * self.kept[kind.__name__] for kind, kb in KEPT_KB.items()) / 1024)

    @property
    def growth_mb(self) -> tuple[float, float]:
        """By how much memory grew after the first of `SHOWN_TIMES`, and by how much it may have for what is kept."""
        return self.rss_mb[-1] - self.rss_mb[0], self.explained_mb[-1] - self.explained_mb[0]

    @property
    def sound_memory(self) -> bool:
        """Whether memory grew no more than it may."""
        grown_mb, explained_mb = self.growth_mb
        return grown_mb <= explained_mb + SLACK_MB


def rss_mb() -> float:
    """The memory of this process."""
    status = Path("/proc/self/status").read_text()
    return next(int(line.split()[1]) for line in status.splitlines() if line.startswith("VmRSS")) / 1024


def drive_of(kind: str) -> Sequence[Measurement]:
    """A sound minute in the car park, of the sensors of `kind`."""
    minute = [thinned(arrival.measurement) for arrival in simulated(World.CARPARK, 1.0).arrivals]
    if kind == "clouds":
        return [as_cloud(m) if isinstance(m, LaserScan) else m for m in minute]
    return [m for m in minute if kind == "scans" or not isinstance(m, Odometry)]


def run(kind: str, messages: int, seed: int) -> Outcome:
    """Feed one drive."""
    outcome = Outcome(kind)
    drive = Drive(load_config((), ()), None, NullLog())
    start_s = time.perf_counter()
    for fed in fuzzed(drive_of(kind), messages, seed):
        feed(drive, fed, outcome)
        if outcome.mutated >= messages * (len(outcome.rss_mb) + 1) // SHOWN_TIMES:
            outcome.measure()
            print(f"{kind}: {outcome.mutated}, {outcome.rss_mb[-1]:.0f} MB", file=sys.stderr, flush=True)  # noqa: T201
    outcome.seconds = time.perf_counter() - start_s
    outcome.dropped = {topic: dict(reasons) for topic, reasons in drive.counters.dropped.items()}
    outcome.warnings = len(drive.counters.warnings)
    finish(drive, outcome)
    return outcome


def finish(drive: Drive, outcome: Outcome) -> None:
    """End a drive: what it was fed must not keep it from that either."""
    try:
        if not np.isfinite(drive.finish().final).all():
            outcome.errors["a final pose that is not finite"] += 1
    except Exception:
        outcome.errors[traceback.format_exc(limit=-3)] += 1


def feed(drive: Drive, fed: Fed, outcome: Outcome) -> None:
    """Feed one message, and note what came of it."""
    outcome.mutated, outcome.sound = outcome.mutated + fed.mutated, outcome.sound + (not fed.mutated)
    start_s = time.process_time()
    try:
        events = drive.feed(fed.sensor, fed.encoding, fed.data)
        drive.show(events)
    except Exception:
        outcome.errors[traceback.format_exc(limit=-3)] += 1
        return
    if fed.mutated and time.process_time() - start_s > SLOW_S:
        what = f"{fed.sensor} {fed.encoding} {len(fed.data)} bytes"
        outcome.slow.append((round((time.process_time() - start_s) * 1e3), what))
    for event in events:
        outcome.take(event)


def lines_of(outcome: Outcome) -> Iterator[str]:
    """What is said of a drive."""
    yield f"{outcome.kind}: {outcome.mutated} mutated, {outcome.sound} sound messages in {outcome.seconds:.0f} s"
    yield f"  exceptions and wrong poses: {outcome.errors.total()}"
    yield from (f"  {count} x {error}" for error, count in outcome.errors.most_common())
    yield f"  memory, MB, at each tenth: {' '.join(f'{mb:.0f}' for mb in outcome.rss_mb)}"
    yield "  grown by {:.0f} MB; what the drive keeps may take {:.0f}".format(*outcome.growth_mb)
    yield f"  events: {dict(outcome.kept)}; different warnings kept: {outcome.warnings}"
    yield f"  mutated messages over {SLOW_S * 1e3:.0f} ms of CPU: {len(outcome.slow)}; {sorted(outcome.slow)[-5:]}"
    yield from (f"  dropped from {topic}: {reasons}" for topic, reasons in outcome.dropped.items())


def main() -> int:
    """Run all drives; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--messages", type=int, default=1_000_000)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    each = [options.messages // len(KINDS) + (i < options.messages % len(KINDS)) for i in range(len(KINDS))]
    sound = True
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(2, mp_context=context, max_tasks_per_child=1) as pool:
        legs = [pool.submit(run, kind, each[i], options.seed + i) for i, kind in enumerate(KINDS)]
        for outcome in (leg.result() for leg in as_completed(legs)):
            print("\n".join(lines_of(outcome)), flush=True)  # noqa: T201 - it is a command
            sound = sound and outcome.sound_memory and not outcome.errors
    return 0 if sound else 1


if __name__ == "__main__":
    sys.exit(main())
