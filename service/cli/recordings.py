"""The commands that make, show or use a recording: simulate, inspect, replay, localize, publish, record; the demo."""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from wayfi.service.cli.options import (
    CalibrationFile,
    Files,
    RecordingPath,
    Settings,
    command,
    configuration,
    playback_rate,
)
from wayfi.service.process.console import Output


@command
def demo(
    output: Output,
    out: Annotated[Path, typer.Option(help="Folder for the recording and the replay.")] = Path("demo_out"),
    minutes: Annotated[float, typer.Option(min=0.5, help="How much of the drive; the whole takes 43.")] = 6.0,
) -> None:
    """Simulate the paper's car park, replay it, score it, and say where to look."""
    from wayfi.service.cli.demo import run_demo

    run_demo(out, minutes, output)


@command
def replay(
    output: Output,
    recording: RecordingPath,
    out: Annotated[Path, typer.Option(help="Folder for the results; made if need be.")],
    rate: Annotated[str, typer.Option(help="Times real time, or max.")] = "max",
    known_map: Annotated[
        Path | None, typer.Option("--map", help="Go on with this saved map: its folder, or results with one.")
    ] = None,
    no_rrd: Annotated[bool, typer.Option("--no-rrd", help="Leave session.rrd out.")] = False,
    config: Files = None,
    settings: Settings = None,
    calibration: CalibrationFile = None,
) -> None:
    """Run a recording through the pipeline: trajectory, map, closures and a scrubbable .rrd."""
    from wayfi.service.cli.run_reports import print_replay
    from wayfi.service.replay.replay import ReplayOptions, replay, settings_for

    options = ReplayOptions(out, playback_rate(rate), not no_rrd, known_map)
    with output.progress(f"replay {recording}") as progress:
        configured, prior = settings_for(recording, config or (), settings or (), calibration)
        report = replay(recording, configured, prior, options, progress)
    print_replay(output, out, report)


@command
def localize(
    output: Output,
    recording: RecordingPath,
    map_path: Annotated[Path, typer.Option("--map", help="Folder of a saved map, or of results with one.")],
    out: Annotated[Path, typer.Option(help="Folder for the results; made if need be.")],
    no_rrd: Annotated[bool, typer.Option("--no-rrd", help="Leave session.rrd out.")] = False,
    config: Files = None,
    settings: Settings = None,
    calibration: CalibrationFile = None,
) -> None:
    """Localise a recording in a saved map, with no initial pose: only poses that are claimed, and the states."""
    from wayfi.service.cli.run_reports import print_localization
    from wayfi.service.replay.localize import localize
    from wayfi.service.replay.replay import ReplayOptions, settings_for

    with output.progress(f"localise {recording}") as progress:
        configured, prior = settings_for(recording, config or (), settings or (), calibration)
        report = localize(recording, map_path, configured, prior, ReplayOptions(out, rrd=not no_rrd), progress)
    print_localization(output, out, report)


@command
def simulate(
    output: Output,
    world: Annotated[str, typer.Argument(help="carpark, office, warehouse, campus, corridor or ring.")],
    out: Annotated[Path, typer.Option(help="Folder for recording.mcap and truth.tum.")],
    seed: Annotated[int, typer.Option(min=0, help="The same bytes for the same seed.")] = 0,
    minutes: Annotated[float | None, typer.Option(min=0.1, help="Cut the drive; full scale without.")] = None,
    robot: Annotated[
        str | None, typer.Option(help="ideal (noise alone), typical (the default), cheap (coarse laser, poor wheels).")
    ] = None,
    rough: Annotated[
        bool | None, typer.Option("--rough/--ideal", help="The same as --robot typical, or --robot ideal.")
    ] = None,
    points: Annotated[bool, typer.Option("--points", help="A 16-beam 3D LiDAR in place of the planar one.")] = False,
) -> None:
    """Make a recording of a simulated robot, and its true trajectory."""
    from wayfi.recordings.simulation.recorder import simulate
    from wayfi.recordings.simulation.worlds.blueprints import World
    from wayfi.service.cli.robots import robot_model

    if world not in list(World):
        raise typer.BadParameter(f"there is no world {world!r}; there are {', '.join(World)}")
    model = robot_model(robot, rough)
    with output.progress(f"simulate {world}") as progress:
        made = simulate(World(world), out, seed, minutes, progress, model, points)
    output.say(f"{made.path_length_m:.0f} m in {made.duration_s:.0f} s, {made.messages} messages: {made.recording}")
    output.result(
        {
            "recording": str(made.recording),
            "truth": str(made.truth),
            "seconds": made.duration_s,
            "metres": made.path_length_m,
            "messages": made.messages,
        }
    )


@command
def inspect(
    output: Output,
    recording: RecordingPath,
    config: Files = None,
    settings: Settings = None,
) -> None:
    """Show what a recording holds, what is wrong with it, and what to type next; exit 1 where it cannot be used.

    Of a saved map, or of results with one: what it holds, and whether it is whole.
    """
    from wayfi.service.maps.describing import describe, is_map

    if is_map(recording):
        from wayfi.service.cli.summaries import print_map

        print_map(output, describe(recording))
        return
    from wayfi.service.cli.summaries import print_diagnosis
    from wayfi.service.replay.diagnosis import diagnose
    from wayfi.service.replay.replay import settings_for

    configured, prior = settings_for(recording, config or (), settings or (), None)
    options = [word for path in config or () for word in ("--config", str(path))]
    options += [word for setting in settings or () for word in ("--set", setting)]
    with output.progress(f"inspect {recording}"):
        diagnosis = diagnose(recording, configured, prior, options)
    print_diagnosis(output, diagnosis)
    if not diagnosis.usable:
        raise typer.Exit(1)


@command
def publish(
    output: Output,
    recording: RecordingPath,
    rate: Annotated[str, typer.Option(help="Times real time, or max.")] = "1.0",
    config: Files = None,
    settings: Settings = None,
) -> None:
    """Put a recording onto Zenoh, as a robot would."""
    from wayfi.service.replay.publish import publish_recording

    with output.progress(f"publish {recording}") as progress:
        summary = publish_recording(recording, configuration(config, settings), playback_rate(rate), progress)
    output.say(f"{sum(summary.messages.values())} messages in {summary.seconds:.1f} s")
    output.warn(summary.warnings)
    output.result(asdict(summary))


@command
def import_file(
    output: Output,
    recording: RecordingPath,
    out: Annotated[Path, typer.Option(help="MCAP file to write.")],
) -> None:
    """Convert a recording of any kind into an MCAP file of ROS 2 messages."""
    from wayfi.service.replay.importing import import_recording

    with output.progress(f"import {recording}") as progress:
        summary = import_recording(recording, out, progress)
    output.say(f"{sum(summary.messages.values())} messages: {out}")
    for type_name, count in summary.left_out.items():
        output.say(f"left out: {count} of {type_name}, which ROS 2 has otherwise or not at all")
    output.warn(summary.warnings)
    output.result(asdict(summary))


@command
def record(
    output: Output,
    out: Annotated[Path, typer.Option(help="MCAP file to write.")],
    config: Files = None,
    settings: Settings = None,
) -> None:
    """Write what sensors put on Zenoh into a recording, until Ctrl-C."""
    from wayfi.service.transport.record import record_topics

    summary = record_topics(out, configuration(config, settings))
    output.say(f"{sum(summary.messages.values())} messages: {out}")
    output.result(asdict(summary))
