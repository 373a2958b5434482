"""A daemon for an hour: one drive after another at 5 times real time, each in a run of its own, begun by a reset.

    python tests/benchmarks/soak.py RECORDING --minutes 60 --rate 5 --out DIR

Writes DIR/soak.csv, a line every five seconds, and DIR/soak.png; exits with 1 where memory or latency is not flat.
"""

import argparse
import csv
import json
import socket
import subprocess
import sys
import time
from collections import defaultdict
from contextlib import suppress
from dataclasses import asdict, dataclass, fields
from pathlib import Path

import matplotlib
import numpy as np
import zenoh

from wayfi.recordings.ros.messages import DIAGNOSTIC_ARRAY, TYPESTORE
from wayfi.service.config import ZenohConfig
from wayfi.service.transport.zenoh_session import UnreachableError, open_guest_session

matplotlib.use("Agg")
CLI = [sys.executable, "-m", "wayfi.service.cli"]
PERIOD_S = 5.0
GROWTH_MB = 20.0  # of the daemon's own process
SETTLED_DRIVES = 2
SLOWER = 2.0


@dataclass(frozen=True, slots=True)
class Look:
    """What was seen at one moment: MB of the daemon and of its helpers, ms from an odometry message to its pose."""

    seconds: float
    drive: int
    daemon_mb: float
    estimation_mb: float
    log_mb: float
    p50_ms: float
    p99_ms: float
    max_ms: float
    dropped: int


class Soak:
    """A daemon in `out`/runs, and what is seen of it."""

    def __init__(self, out: Path) -> None:
        self.looks: list[Look] = []
        self.drive = 0
        port = _free_port()
        self._config = ZenohConfig(listen=[f"tcp/127.0.0.1:{port}"])
        values = (
            f"zenoh.listen={self._config.listen}",
            f"recording.directory={out / 'runs'}",
            "recording.budget_mb=2000",
        )
        self._settings = [w for v in (*values, f"rerun.port={_free_port()}") for w in ("--set", v)]
        with (out / "stderr").open("w") as stderr:
            self._daemon = subprocess.Popen([*CLI, "run", *self._settings], stderr=stderr)
        self._begun_s = time.monotonic()
        self._status: dict[str, str] = {}

    def run(self, recording: Path, minutes: float, rate: float, drives: int = 1_000_000) -> int:
        """Drive after drive until the time is over or there were `drives`; returns the daemon's exit code."""
        with self._meet() as session:
            session.declare_subscriber("wayfi/status", self._hear)
            while self._daemon.poll() is None and self.drive < drives:
                if time.monotonic() - self._begun_s > minutes * 60:
                    break
                self.drive += 1
                self._wait_until_ready(session)
                publish = [*CLI, "publish", str(recording), "--rate", str(rate), "--quiet", *self._settings]
                with subprocess.Popen(publish) as publisher:
                    while publisher.poll() is None:
                        self._look_after(publisher)
                list(session.get("wayfi/command/reset", timeout=10.0))
        self._daemon.terminate()
        return self._daemon.wait(timeout=120)

    def _look_after(self, publisher: "subprocess.Popen[bytes]") -> None:
        """Look when five seconds are over, or the drive is."""
        with suppress(subprocess.TimeoutExpired):
            publisher.wait(timeout=PERIOD_S)
        self._look()

    def _meet(self) -> zenoh.Session:
        while True:
            try:
                return open_guest_session(self._config)
            except UnreachableError:
                time.sleep(0.2)

    def _wait_until_ready(self, session: zenoh.Session) -> None:
        time.sleep(1.0)
        while not any(r.ok for r in session.liveliness().get("wayfi/alive", timeout=1.0)):
            time.sleep(0.2)

    def _hear(self, sample: zenoh.Sample) -> None:
        (status,) = TYPESTORE.deserialize_cdr(sample.payload.to_bytes(), DIAGNOSTIC_ARRAY).status
        self._status = {pair.key: pair.value for pair in status.values}

    def _look(self) -> None:
        status, mb = self._status, _memory_mb(self._daemon.pid)
        latency = [float(status.get(f"latency.{name}_ms", "nan")) for name in ("p50", "p99", "max")]
        dropped = sum(int(n) for key, n in status.items() if key.startswith("dropped."))
        seconds = round(time.monotonic() - self._begun_s, 1)
        self.looks.append(Look(seconds, self.drive, mb["run"], mb["estimator"], mb["log_server"], *latency, dropped))


def _memory_mb(pid: int) -> dict[str, float]:
    """Resident memory of a process and of those below it, MB, by what they run."""
    found: defaultdict[str, float] = defaultdict(float)
    waiting = [pid]
    while waiting:
        pid = waiting.pop()
        try:
            command = Path(f"/proc/{pid}/cmdline").read_text()
            pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
            children = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
        except OSError:
            continue
        found[next((name for name in ("estimator", "log_server") if name in command), "run")] += pages * 4096 / 1e6
        waiting += [int(child) for child in children]
    return found


def growth_mb(looks: list[Look]) -> float:
    """By how much the most that the daemon's own process took grew, from the first third of the drives to the last.

    The first `SETTLED_DRIVES` do not count. What it takes goes up and down: two single drives say nothing.
    """
    by_drive = [[x.daemon_mb for x in looks if x.drive == n] for n in sorted({x.drive for x in looks})]
    thirds = np.array_split(np.array([np.median(mb) for mb in by_drive[SETTLED_DRIVES:]]), 3)
    return float(thirds[-1].max() - thirds[0].max()) if len(thirds[-1]) else 0.0


def slower(looks: list[Look]) -> float:
    """The last third's median p99 over the first's."""
    thirds = np.array_split(np.array([x.p99_ms for x in looks if np.isfinite(x.p99_ms)]), 3)
    return float(np.median(thirds[-1]) / np.median(thirds[0]))


def plot(looks: list[Look], path: Path) -> None:
    """Memory and latency over the hour."""
    import matplotlib.pyplot as plt

    minutes = [x.seconds / 60 for x in looks]
    figure, (memory, latency) = plt.subplots(2, 1, figsize=(9, 6), sharex=True, layout="constrained")
    for name, label in (("daemon_mb", "daemon"), ("estimation_mb", "estimation"), ("log_mb", "log")):
        memory.plot(minutes, [getattr(x, name) for x in looks], label=label)
    memory.set(ylabel="resident memory, MB", title="The daemon at 5 times real time, a reset between two drives")
    memory.legend(loc="upper right")
    for name in ("p50_ms", "p99_ms", "max_ms"):
        latency.plot(minutes, [getattr(x, name) for x in looks], label=name.removesuffix("_ms"))
    latency.set(ylabel="odometry in to pose out, ms", xlabel="minutes", yscale="log")
    latency.legend(loc="upper right")
    figure.savefig(path, dpi=100)


def main() -> int:
    """Run it; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recording", type=Path)
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--rate", type=float, default=5.0)
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    soak = Soak(options.out)
    code = soak.run(options.recording, options.minutes, options.rate)
    with (options.out / "soak.csv").open("w") as file:
        rows = csv.DictWriter(file, [f.name for f in fields(Look)])
        rows.writeheader()
        rows.writerows(asdict(look) for look in soak.looks)
    plot(soak.looks, options.out / "soak.png")
    figures = {"exit": code, "drives": soak.drive, "growth_mb": growth_mb(soak.looks), "slower": slower(soak.looks)}
    print(json.dumps(figures))  # noqa: T201 - it is a command
    return int(code != 0 or figures["growth_mb"] > GROWTH_MB or figures["slower"] > SLOWER)


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


if __name__ == "__main__":
    sys.exit(main())
