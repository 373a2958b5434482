"""The command line. Exit 0; 1 with one line on what is wrong with the data or the world; 2 for usage and unknown keys.

Each command imports what it needs when it runs, so that `wayfi --help` answers at once.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from wayfi.backend.errors import WayfiError
from wayfi.service.process.console import Output

if TYPE_CHECKING:
    from wayfi.frontends.calibration import Calibration
    from wayfi.service.config import Config

app = typer.Typer(
    help="Streaming SLAM for robots indoors: wheels, WiFi and LiDAR into one map.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)

Quiet = Annotated[bool, typer.Option("--quiet", help="Say nothing but errors.")]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout and nothing else.")]
Files = Annotated[list[Path] | None, typer.Option("--config", help="TOML file; later ones win.")]
Settings = Annotated[list[str] | None, typer.Option("--set", help="section.key=VALUE, above every file; repeatable.")]
CalibrationFile = Annotated[Path | None, typer.Option("--calibration", help="calibration.toml of an earlier drive.")]
RecordingPath = Annotated[Path, typer.Argument(help="MCAP file, folder of parts, or a daemon's run folder.")]


@contextmanager
def _output(quiet: bool, as_json: bool) -> Iterator[Output]:
    """The output of a command; known errors become one line and the exit code that fits."""
    output = Output(quiet, as_json)
    try:
        yield output
    except WayfiError as error:
        from wayfi.service.config import ConfigError

        output.error(str(error))
        raise typer.Exit(2 if isinstance(error, ConfigError) else 1) from None
    except KeyboardInterrupt:
        output.error("interrupted")
        raise typer.Exit(130) from None


def _configured(files: list[Path] | None, settings: list[str] | None) -> "Config":
    from wayfi.service.config import load_config

    return load_config(files or (), settings or ())


def _calibration(path: Path | None) -> "Calibration | None":
    from wayfi.recordings.files.calibration_file import read_calibration

    return read_calibration(path) if path else None


@app.command()
def demo(
    out: Annotated[Path, typer.Option(help="Folder for the recording and the replay.")] = Path("demo_out"),
    minutes: Annotated[float, typer.Option(min=0.5, help="How much of the drive; the whole takes 43.")] = 6.0,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Simulate the paper's car park, replay it, score it, and say where to look."""
    with _output(quiet, as_json) as output:
        from wayfi.service.cli.demo import run_demo

        run_demo(out, minutes, output)


@app.command()
def replay(
    recording: RecordingPath,
    out: Annotated[Path, typer.Option(help="Folder for the results; made if need be.")],
    rate: Annotated[str, typer.Option(help="Times real time, or max.")] = "max",
    no_rrd: Annotated[bool, typer.Option("--no-rrd", help="Leave session.rrd out.")] = False,
    config: Files = None,
    settings: Settings = None,
    calibration: CalibrationFile = None,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Run a recording through the pipeline: trajectory, map, closures and a scrubbable .rrd."""
    with _output(quiet, as_json) as output:
        from wayfi.service.cli.summaries import say_replay
        from wayfi.service.replay.replay import ReplayOptions, replay, settings_for

        options = ReplayOptions(out, _rate(rate), not no_rrd)
        with output.progress(f"replay {recording}") as progress:
            configured, prior = settings_for(recording, config or (), settings or (), calibration)
            report = replay(recording, configured, prior, options, progress)
        say_replay(output, out, report)


@app.command()
def evaluate(
    directory: Annotated[Path, typer.Argument(help="Folder of a replay.")],
    truth: Annotated[Path, typer.Option(help="Reference trajectory, TUM.")],
    relations: Annotated[Path | None, typer.Option(help="Hand-checked relations: t1 t2 dx dy dtheta.")] = None,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Score a replay against a reference: ATE, RPE, relations, closures, covariances; with plots."""
    with _output(quiet, as_json) as output:
        from wayfi.service.cli.summaries import say_evaluation
        from wayfi.service.evaluation.evaluate import evaluate, write_evaluation
        from wayfi.service.evaluation.plots import write_plots

        evaluation = evaluate(directory, truth, relations)
        write_evaluation(directory, evaluation)
        write_plots(directory, evaluation)
        say_evaluation(output, directory, evaluation)


@app.command()
def simulate(
    world: Annotated[str, typer.Argument(help="carpark, office, warehouse or campus.")],
    out: Annotated[Path, typer.Option(help="Folder for recording.mcap and truth.tum.")],
    seed: Annotated[int, typer.Option(min=0, help="The same bytes for the same seed.")] = 0,
    minutes: Annotated[float | None, typer.Option(min=0.1, help="Cut the drive; full scale without.")] = None,
    rough: Annotated[bool, typer.Option("--rough/--ideal", help="Sensors as they are, or at their best.")] = True,
    points: Annotated[bool, typer.Option("--points", help="A 16-beam 3D LiDAR in place of the planar one.")] = False,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Make a recording of a simulated robot, and its true trajectory beside it."""
    with _output(quiet, as_json) as output:
        from wayfi.recordings.simulation.recorder import simulate
        from wayfi.recordings.simulation.worlds import World

        if world not in list(World):
            raise typer.BadParameter(f"there is no world {world!r}; there are {', '.join(World)}")
        with output.progress(f"simulate {world}") as progress:
            made = simulate(World(world), out, seed, minutes, progress, rough, points)
        output.say(f"{made.path_length_m:.0f} m in {made.duration_s:.0f} s, {made.messages} messages: {made.recording}")
        files = {"recording": str(made.recording), "truth": str(made.truth)}
        figures = {"seconds": made.duration_s, "metres": made.path_length_m, "messages": made.messages}
        output.result(files | figures)


@app.command()
def reproduce(
    recording: Annotated[Path | None, typer.Option(help="MCAP with WiFi; without it a car park is simulated.")] = None,
    truth: Annotated[Path | None, typer.Option(help="Reference trajectory of the recording, TUM.")] = None,
    out: Annotated[Path, typer.Option(help="Folder for tables and plots; made if need be.")] = Path("reproduce_out"),
    minutes: Annotated[float | None, typer.Option(min=0.5, help="Cut the simulated drive; full scale without.")] = None,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Run the paper's Algorithm 1 as written, and print its tables beside the streaming result."""
    if (recording is None) != (truth is None):
        raise typer.BadParameter("--recording and --truth go together: give both or neither")
    if recording is not None and minutes is not None:
        raise typer.BadParameter("--minutes cuts the simulated drive; a recording is taken whole")
    with _output(quiet, as_json) as output:
        from wayfi.service.reproduction.command import reproduce, simulate_carpark

        if recording is None or truth is None:
            recording, truth = simulate_carpark(out, minutes, output)
        reproduce(recording, truth, out, output)


@app.command()
def inspect(
    recording: RecordingPath,
    config: Files = None,
    settings: Settings = None,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Show what a recording holds: topics, rates, gaps, time faults, and what a replay would use."""
    with _output(quiet, as_json) as output:
        from wayfi.recordings.inspection import inspect_recording
        from wayfi.service.cli.summaries import say_inspection

        inspection = inspect_recording(recording, _configured(config, settings).recording.topics)
        say_inspection(output, inspection)
        if not inspection.usable:
            raise WayfiError(f"{recording}: neither odometry nor scans: a replay has nothing to do")


@app.command()
def run(
    config: Files = None,
    settings: Settings = None,
    calibration: CalibrationFile = None,
    fresh: Annotated[bool, typer.Option("--fresh", help="Begin a new run, even where one was cut off.")] = False,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Run the daemon: Zenoh in, Zenoh out, black box, live Rerun; SIGINT and SIGTERM end it."""
    with _output(quiet, as_json) as output:
        from wayfi.service.daemon.run import run_daemon

        code = run_daemon(_configured(config, settings), _calibration(calibration), fresh, quiet)
        output.result({"exit_code": code})
    raise typer.Exit(code)


@app.command()
def publish(
    recording: RecordingPath,
    rate: Annotated[str, typer.Option(help="Times real time, or max.")] = "1.0",
    config: Files = None,
    settings: Settings = None,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Put a recording onto Zenoh, as a robot would."""
    with _output(quiet, as_json) as output:
        from dataclasses import asdict

        from wayfi.service.replay.publish import publish_recording

        with output.progress(f"publish {recording}") as progress:
            summary = publish_recording(recording, _configured(config, settings), _rate(rate), progress)
        output.say(f"{sum(summary.messages.values())} messages in {summary.seconds:.1f} s")
        output.result(asdict(summary))


@app.command()
def record(
    out: Annotated[Path, typer.Option(help="MCAP file to write.")],
    config: Files = None,
    settings: Settings = None,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Write what sensors put on Zenoh into a recording, until Ctrl-C."""
    with _output(quiet, as_json) as output:
        from dataclasses import asdict

        from wayfi.service.transport.record import record_topics

        summary = record_topics(out, _configured(config, settings))
        output.say(f"{sum(summary.messages.values())} messages: {out}")
        output.result(asdict(summary))


@app.command()
def view(
    path: Annotated[Path, typer.Argument(help="Folder of a replay or a run, or an .rrd file.")],
    web: Annotated[bool, typer.Option("--web", help="Serve the web viewer on 127.0.0.1.")] = False,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Open a drive in the Rerun viewer."""
    with _output(quiet, as_json) as output:
        from wayfi.recordings.rerun.viewer import view

        view(path, web)
        output.result({"viewed": str(path)})


@app.command(name="warm-up")
def compile_all(quiet: Quiet = False, as_json: Json = False) -> None:
    """Compile what runs compiled, once after installation; else the first replay or run does it."""
    with _output(quiet, as_json) as output:
        from wayfi.service.cli.warm_up import run_warm_up

        run_warm_up(output)


@app.command(name="config")
def show_config(config: Files = None, settings: Settings = None, quiet: Quiet = False, as_json: Json = False) -> None:
    """Print the configuration in force, with units and the reason for each default."""
    with _output(quiet, as_json) as output:
        from wayfi.service.config import config_dict, config_toml

        configured = _configured(config, settings)
        output.say(config_toml(configured, explain=True).rstrip("\n"))
        output.result(config_dict(configured))


def _rate(text: str) -> float | None:
    if text == "max":
        return None
    try:
        rate = float(text)
    except ValueError:
        rate = 0.0
    if not 0 < rate < float("inf"):
        raise typer.BadParameter(f"--rate {text}: must be max or a number above zero")
    return rate


def main() -> None:
    """The entry point of `wayfi`."""
    app()
