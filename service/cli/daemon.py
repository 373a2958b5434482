"""The command that runs the daemon."""

from pathlib import Path
from typing import Annotated

import typer

from wayfi.service.cli.options import (
    CalibrationFile,
    Files,
    Settings,
    calibration_of,
    command,
    configuration,
)
from wayfi.service.drive.mode import Mode
from wayfi.service.process.console import Output


@command
def run(
    output: Output,
    config: Files = None,
    settings: Settings = None,
    calibration: CalibrationFile = None,
    map_path: Annotated[
        Path | None, typer.Option("--map", help="Begin in this saved map: its folder, or results with one.")
    ] = None,
    mode: Annotated[
        Mode | None, typer.Option(help="Localise in the map (with --map, the default), or go on making it.")
    ] = None,
    fresh: Annotated[bool, typer.Option("--fresh", help="Begin a new run, even where one was cut off.")] = False,
    merge: Annotated[
        bool, typer.Option("--merge", help="Join the maps of the robots that answer, instead of making one.")
    ] = False,
) -> None:
    """Run the daemon: Zenoh in, Zenoh out, black box, live Rerun; SIGINT and SIGTERM end it."""
    from wayfi.service.daemon.run import run_daemon, run_merging_daemon
    from wayfi.service.drive.known_map import MapReference

    configured, prior = configuration(config, settings), calibration_of(calibration)
    if merge and (map_path or mode or fresh or calibration):
        raise typer.BadParameter("makes no map of its own: leave the other options out", param_hint="--merge")
    if mode is Mode.LOCALIZATION and map_path is None:
        raise typer.BadParameter("localization needs a map: give --map", param_hint="--mode")
    known = MapReference.of(map_path, mode or Mode.LOCALIZATION) if map_path else None
    if merge:
        code = run_merging_daemon(configured, output.quiet)
    else:
        code = run_daemon(configured, prior, fresh, output.quiet, known)
    output.result({"exit_code": code})
    raise typer.Exit(code)
