"""What the commands share: their common options, the output and exit code of each, and values read from options."""

import inspect
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from wayfi.backend.errors import WayfiError
from wayfi.service.process.console import Output, close_stdout

if TYPE_CHECKING:
    from wayfi.frontends.calibration import Calibration
    from wayfi.service.config import Config

Quiet = Annotated[bool, typer.Option("--quiet", help="Say nothing but errors.")]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout and nothing else.")]
Files = Annotated[list[Path] | None, typer.Option("--config", help="TOML file; later ones win.")]
Settings = Annotated[list[str] | None, typer.Option("--set", help="section.key=VALUE, above every file; repeatable.")]
CalibrationFile = Annotated[Path | None, typer.Option("--calibration", help="calibration.toml of an earlier drive.")]
RecordingPath = Annotated[
    Path, typer.Argument(help="MCAP, rosbag2, ROS 1 bag or CARMEN log: file or folder of parts; or a run's.")
]


def command(function: Callable[..., None]) -> Callable[..., None]:
    """`function` as a command: --quiet and --json in place of its parameter `output`, and one line for known errors."""

    @wraps(function)
    def called(*, quiet: bool, as_json: bool, **options: object) -> None:
        with _command_output(quiet, as_json) as output:
            function(output, **options)

    own = [p for p in inspect.signature(function).parameters.values() if p.name != "output"]
    common = [
        inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=False, annotation=annotation)
        for name, annotation in (("quiet", Quiet), ("as_json", Json))
    ]
    called.__signature__ = inspect.Signature([*own, *common])  # type: ignore[attr-defined]
    return called


@contextmanager
def _command_output(quiet: bool, as_json: bool) -> Iterator[Output]:
    """The output of a command. Known errors end it with one line: exit 2 for the configuration, 1 for the rest."""
    output = Output(quiet, as_json)
    try:
        yield output
    except WayfiError as error:
        from wayfi.service.config import ConfigError

        output.error(str(error))
        raise typer.Exit(2 if isinstance(error, ConfigError) else 1) from None
    except BrokenPipeError:  # whoever reads the output has seen enough
        close_stdout()
        raise typer.Exit(1) from None
    except OSError as error:
        output.error(f"{error.filename}: {error.strerror}" if error.filename else str(error))
        raise typer.Exit(1) from None
    except KeyboardInterrupt as interrupt:
        output.error(": ".join(["interrupted", *getattr(interrupt, "__notes__", [])]))
        raise typer.Exit(130) from None


def configuration(files: list[Path] | None, settings: list[str] | None) -> "Config":
    """The configuration that --config and --set ask for. Raises ConfigError."""
    from wayfi.service.config import load_config

    return load_config(files or (), settings or ())


def calibration_of(path: Path | None) -> "Calibration | None":
    """The calibration that --calibration names. Raises CalibrationError."""
    from wayfi.recordings.files.calibration_file import read_calibration

    return read_calibration(path) if path else None


def playback_rate(text: str) -> float | None:
    """The number that --rate gives, None for max. Raises typer.BadParameter."""
    if text == "max":
        return None
    try:
        rate = float(text)
    except ValueError:
        rate = 0.0
    if not 0 < rate < float("inf"):
        raise typer.BadParameter(f"--rate {text}: must be max or a number above zero")
    return rate
