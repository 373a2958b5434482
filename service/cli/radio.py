"""The command about the radio of a building: radio."""

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from wayfi.service.cli.options import Files, Settings, command, configuration
from wayfi.service.process.console import Output

if TYPE_CHECKING:
    from wayfi.frontends.radio.radio_map import RadioMap


@command
def radio(
    output: Output,
    path: Annotated[Path, typer.Argument(help="Folder of a saved map, or of the replay that made it.")],
    out: Annotated[Path, typer.Option(help="Folder for tables, GeoTIFF and picture; made if need be.")],
    floor: Annotated[int, typer.Option(help="The floor of the map.")] = 0,
    config: Files = None,
    settings: Settings = None,
) -> None:
    """Map the radio of a building: each access point's level and place, and what all of them cover."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # its matrices are small: threads only wait for each other
    from wayfi.frontends.radio.radio_map import radio_map
    from wayfi.recordings.map.loading import load_map
    from wayfi.recordings.radio.writing import write_radio_map
    from wayfi.recordings.rerun.radio_log import write_radio_log
    from wayfi.recordings.rerun.viewer import RADIO_LOG

    chosen = configuration(config, settings).radio
    loaded = load_map(path)
    output.warn(loaded.warnings)
    with output.progress(f"radio {path}") as progress:
        made = radio_map(loaded.building, chosen, floor, progress)
        grid = loaded.building.grid_of(floor)
        write_radio_map(out, made, grid)
        write_radio_log(out / RADIO_LOG, made, grid)
    found = _summary(made)
    for line in _lines(found):
        output.say(line)
    output.say(f"{out / 'radio.png'}; wayfi view {out}")
    output.result({"out": str(out), **found, "warnings": list(loaded.warnings)})


def _summary(made: "RadioMap") -> dict[str, Any]:
    """The figures of a radio map."""
    from wayfi.frontends.radio.radio_map import Standing
    from wayfi.recordings.radio.picture import KNOWN_M

    sigmas = [ap.sigmas_m[0] for ap in made.access_points if ap.sigmas_m]
    standing = {kind.name.lower(): sum(ap.standing is kind for ap in made.access_points) for kind in Standing}
    elsewhere = Standing.MOVED, Standing.CARRIED
    told = [{"bssid": ap.bssids[0], "why": ap.standing.value} for ap in made.access_points if ap.standing in elsewhere]
    return {
        "bssids": sum(len(ap.bssids) for ap in made.access_points),
        "access_points": len(made.access_points),
        **standing,
        "placed_within_m": KNOWN_M,
        "placed": sum(sigma <= KNOWN_M for sigma in sigmas),
        "square_metres": round(len(made.cells.xy) * made.cells.cell_m**2),
        "usable_dbm": made.usable_dbm,
        "holes_square_metres": round(int(made.holes().sum()) * made.cells.cell_m**2),
        "told": told,
    }


def _lines(found: dict[str, Any]) -> list[str]:
    """What a person reads of a radio map."""
    few, stands = found["few"], found["stands"]
    return [
        f"{found['access_points']} access points with {found['bssids']} BSSIDs: {found['placed']} are placed to"
        f" {found['placed_within_m']:g} m, {stands - found['placed']} worse: weak, or outside of what was driven",
        *([f"{few} were heard at too few places to have a position"] if few else []),
        f"{found['holes_square_metres']} of {found['square_metres']} m2 are below {found['usable_dbm']:g} dBm",
        *(f"{each['bssid']} {each['why']}" for each in found["told"]),
    ]
