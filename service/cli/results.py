"""The commands about the result of a drive: evaluate, reproduce, view."""

from pathlib import Path
from typing import Annotated

import typer

from wayfi.service.cli.options import command
from wayfi.service.process.console import Output


@command
def evaluate(
    output: Output,
    directory: Annotated[Path, typer.Argument(help="Folder of a replay.")],
    truth: Annotated[Path, typer.Option(help="Reference trajectory, TUM.")],
    relations: Annotated[Path | None, typer.Option(help="Hand-checked relations: t1 t2 dx dy dtheta.")] = None,
) -> None:
    """Score a replay against a reference: ATE, RPE, relations, closures, covariances; with plots."""
    from wayfi.recordings.files.result_folder import note_of_later_run
    from wayfi.service.cli.summaries import print_evaluation
    from wayfi.service.evaluation.evaluate import evaluate, write_evaluation
    from wayfi.service.evaluation.plots import write_plots

    evaluation = evaluate(directory, truth, relations)
    write_evaluation(directory, evaluation)
    write_plots(directory, evaluation)
    print_evaluation(output, directory, evaluation)
    if note := note_of_later_run(directory):
        output.say(f"warning: {note}")


@command
def reproduce(
    output: Output,
    recording: Annotated[Path | None, typer.Option(help="MCAP with WiFi; without it a car park is simulated.")] = None,
    truth: Annotated[Path | None, typer.Option(help="Reference trajectory of the recording, TUM.")] = None,
    out: Annotated[Path, typer.Option(help="Folder for tables and plots; made if need be.")] = Path("reproduce_out"),
    minutes: Annotated[float | None, typer.Option(min=0.5, help="Cut the simulated drive; full scale without.")] = None,
) -> None:
    """Run the paper's Algorithm 1 as written, and print its tables next to the streaming result."""
    if (recording is None) != (truth is None):
        raise typer.BadParameter("--recording and --truth go together: give both or neither")
    if recording is not None and minutes is not None:
        raise typer.BadParameter("--minutes cuts the simulated drive; a recording is used whole")
    from wayfi.service.reproduction.command import reproduce, simulate_carpark

    if recording is None or truth is None:
        recording, truth = simulate_carpark(out, minutes, output)
    reproduce(recording, truth, out, output)


@command
def view(
    output: Output,
    path: Annotated[Path, typer.Argument(help="Folder of a replay or a run, or an .rrd file.")],
    web: Annotated[bool, typer.Option("--web", help="Serve the web viewer on 127.0.0.1.")] = False,
) -> None:
    """Open a drive in the Rerun viewer."""
    from wayfi.recordings.files.result_folder import note_of_later_run, why_not_whole
    from wayfi.recordings.rerun.viewer import view

    if note := why_not_whole(path) or note_of_later_run(path):
        output.say(f"warning: {note}")
    view(path, web)
    output.result({"viewed": str(path)})
