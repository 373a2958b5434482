"""The command line. Exit 0; 1 with one line on what is wrong with the data or the world; 2 for usage and unknown keys.

Each command imports what it needs when it runs, so that `wayfi --help` answers at once.
"""

import typer

from wayfi.service.cli.configuration import compile_all, show_config
from wayfi.service.cli.daemon import run
from wayfi.service.cli.maps import align, closures, merge
from wayfi.service.cli.radio import radio
from wayfi.service.cli.recordings import demo, import_file, inspect, localize, publish, record, replay, simulate
from wayfi.service.cli.results import evaluate, reproduce, view
from wayfi.service.process.collection import collect_seldom
from wayfi.service.process.compilation import ensure_cache

app = typer.Typer(
    help="Streaming SLAM for robots indoors: wheels, WiFi and LiDAR into one map.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)
for command in (
    demo,
    replay,
    localize,
    evaluate,
    simulate,
    reproduce,
    inspect,
    run,
    publish,
    record,
    view,
    closures,
    merge,
    align,
    radio,
):
    app.command()(command)
app.command(name="import")(import_file)
app.command(name="config")(show_config)
app.command(name="warm-up")(compile_all)


def main() -> None:
    """The entry point of `wayfi`."""
    collect_seldom()
    ensure_cache()
    app()
