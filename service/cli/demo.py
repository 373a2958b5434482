"""`wayfi demo`: simulates a car park, replays and scores the drive."""

from pathlib import Path

from wayfi.recordings.simulation.recorder import simulate
from wayfi.recordings.simulation.worlds.blueprints import World
from wayfi.service.cli.summaries import print_evaluation
from wayfi.service.config import Config
from wayfi.service.evaluation.evaluate import evaluate, write_evaluation
from wayfi.service.evaluation.plots import write_plots
from wayfi.service.process.console import Output
from wayfi.service.replay.replay import ReplayOptions, replay


def run_demo(out: Path, minutes: float, output: Output) -> None:
    """Simulate `minutes` of the car park into `out`, replay them into `out`/replay, and print the scores."""
    with output.progress("simulate the car park") as progress:
        made = simulate(World.CARPARK, out, 0, minutes, progress)
    results = out / "replay"
    with output.progress("replay the drive") as progress:
        replay(made.recording, Config(), None, ReplayOptions(results), progress)
    evaluation = evaluate(results, made.truth)
    write_evaluation(results, evaluation)
    write_plots(results, evaluation)
    output.say(f"A robot drove {made.path_length_m:.0f} m through a car park in {made.duration_s / 60:.0f} minutes.")
    print_evaluation(output, results, evaluation)
    output.say(f"The map:    {results / 'map.png'}")
    output.say(f"The drive:  wayfi view {results}")
