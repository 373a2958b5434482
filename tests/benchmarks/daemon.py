"""`wayfi run` under a drive that is published: what is dropped, how late a pose is, whether the black box replays.

    python tests/benchmarks/daemon.py [--minutes M] [--rates R ...]     at multiples of real time, a viewer drawing it
    python tests/benchmarks/daemon.py [--minutes M] --kills N [--seed S]    kill -9 at random moments, in real time

The drive is a simulated car park's. The viewer is Rerun's own without a window; without a graphics card it needs a
software renderer of Vulkan (mesa-vulkan-drivers).
"""

import argparse
import random
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "helpers"))
from drives import Simulated, run, simulated, write
from live.daemons import Robot, Running, accepts, routing, running
from live.kills import kill_after
from live.loopback import endpoint, eventually, free_port
from live.runs import error_m, replays_alike, report_of
from rerun.experimental import ViewerClient

from wayfi.recordings.mcap.recording import open_recording
from wayfi.recordings.simulation.worlds.blueprints import World

UNDISTURBED_S = 20.0  # at the end of the drive that is killed
BETWEEN_PICTURES_S = 0.5


def main() -> None:
    """Measure what was asked for, and print it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, default=1.5)
    parser.add_argument("--rates", type=float, nargs="+", default=[1.0, 5.0, 20.0])
    parser.add_argument("--kills", type=int, default=0)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        drive = simulated(World.CARPARK, arguments.minutes)
        if arguments.kills:
            chance, last_s = random.Random(arguments.seed), arguments.minutes * 60 - UNDISTURBED_S
            say_kills(folder, drive, sorted(chance.uniform(0.0, last_s) for _ in range(arguments.kills)))
        else:
            recording = write(folder / "recording.mcap", drive.arrivals)
            say("rate", "messages", "dropped", "closures checked", "p50 ms", "p99 ms", "max ms", "replays alike")
            for rate in arguments.rates:
                say_rate(folder / f"{rate:g}", recording, rate)


def say_rate(folder: Path, recording: Path, rate: float) -> None:
    """One line of the table."""
    with running(folder / "runs") as daemon, drawing(daemon.rerun_port):
        daemon.publish(recording, rate)
        stopped(daemon)
    report = report_of(daemon.folder)
    dropped = ", ".join(f"{topic} {n} {why}" for topic, whys in report["dropped"].items() for why, n in whys.items())
    latencies = [f"{report['latency'][name]:.1f}" for name in ("p50_ms", "p99_ms", "max_ms")]
    with (daemon.folder / "closures.csv").open() as lines:
        closures = str(sum(1 for _ in lines) - 1)
    alike = "yes" if replays_alike(daemon.folder, folder / "replayed") else "NO"
    say(f"{rate:g}", str(sum(report["messages"].values())), dropped or "nothing", closures, *latencies, alike)


@contextmanager
def drawing(port: int) -> Iterator[None]:
    """A viewer that draws the live log all the while."""
    eventually(lambda: accepts(f"tcp/127.0.0.1:{port}"))
    over = threading.Event()
    with ViewerClient.spawn(headless=True, port=free_port(), hide_welcome_screen=True) as viewer:
        viewer.open(f"rerun+http://127.0.0.1:{port}/proxy")
        drawer = threading.Thread(target=draw, args=(viewer, over))
        drawer.start()
        try:
            yield
        finally:
            over.set()
            drawer.join()
        if not viewer.get_state().active_recording:
            sys.exit("the viewer has seen nothing")


def draw(viewer: ViewerClient, over: threading.Event) -> None:
    """A picture is what a viewer without a window draws for."""
    with tempfile.TemporaryDirectory() as folder:
        while not over.wait(BETWEEN_PICTURES_S):
            viewer.save_screenshot(str(Path(folder) / "drawn.png"))


def say_kills(folder: Path, drive: Simulated, moments_s: list[float]) -> None:
    """Kill a daemon that long after the start, or as soon as it is back, while a robot drives on."""
    recording, router = write(folder / "recording.mcap", drive.arrivals), endpoint()
    poses_s: list[float] = []
    with routing(router) as session, running(folder / "runs", router=router) as daemon:
        heard = session.declare_subscriber(daemon.key("wayfi/pose"), lambda _: poses_s.append(time.monotonic()))
        robot, begun_s = Robot(daemon, recording, 1.0), time.monotonic()
        robot.start()
        kills = [kill_after(daemon, max(0.0, begun_s + moment_s - time.monotonic())) for moment_s in moments_s]
        robot.finish()
        stopped(daemon)
        heard.undeclare()
    kept = {record.data for record in open_recording(daemon.folder)}
    say("kill", "back after s", "input lost s", "messages readable", "cells of map")
    for number, kill in enumerate(kills, 1):
        back_s = min((at_s for at_s in poses_s if at_s > kill.killed_s), default=float("nan")) - kill.killed_s
        say(str(number), f"{back_s:.2f}", f"{kill.lost_s(robot, kept):.2f}", str(kill.messages), str(kill.map_cells))
    run(recording, folder / "undisturbed")
    ours_m, undisturbed_m = (error_m(out, drive.truth) for out in (daemon.folder, folder / "undisturbed"))
    say(f"ATE {ours_m:.3f} m, undisturbed {undisturbed_m:.3f} m: {ours_m / undisturbed_m:.2f} times")
    say(f"runs: {len(list(daemon.directory.iterdir()))}")
    say("replays alike: " + ("yes" if replays_alike(daemon.folder, folder / "replayed") else "NO"))


def stopped(daemon: Running) -> None:
    """Stop a daemon; it has to end cleanly."""
    if daemon.stop() != 0:
        sys.exit(daemon.stderr)


def say(*cells: str) -> None:
    """Print a line of a table."""
    sys.stdout.write(" | ".join(cells) + "\n")
    sys.stdout.flush()


if __name__ == "__main__":
    main()
