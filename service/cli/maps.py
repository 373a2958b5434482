"""The commands about saved maps: closures, merge, align."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from wayfi.service.cli.options import Files, Settings, command, configuration
from wayfi.service.process.console import Output

if TYPE_CHECKING:
    from wayfi.frontends.maps.editing import ListedClosure
    from wayfi.recordings.map.manifest import MapName


@command
def closures(
    output: Output,
    map_path: Annotated[Path, typer.Argument(metavar="MAP", help="Folder of a saved map, or of results with one.")],
    veto: Annotated[list[int] | None, typer.Option(help="Number of a closure to take out; repeatable.")] = None,
    restore: Annotated[list[int] | None, typer.Option(help="Number of a vetoed one to put back; repeatable.")] = None,
    every: Annotated[bool, typer.Option("--all", help="List the refused ones as well.")] = False,
    config: Files = None,
    settings: Settings = None,
) -> None:
    """List the closures of a map; take some out or put them back, which optimises and saves the map anew."""
    from wayfi.service.maps.editing import closures

    with output.progress(f"closures {map_path}"):
        found = closures(map_path, veto or (), restore or (), configuration(config, settings))
    output.warn(found.warnings)
    if veto or restore:
        output.say(f"{map_path}: version {found.name.map_version}, moved by {found.moved_m:.3f} m at most")
    else:
        _print_closures(output, found.closures, every)
    rows = [_without_nan(row) for row in found.closures]
    output.result({**_named(map_path, found.name), "moved_m": found.moved_m, "closures": rows})


@command
def merge(
    output: Output,
    first: Annotated[Path, typer.Argument(metavar="A", help="Folder of a map, whose frame is kept.")],
    second: Annotated[Path, typer.Argument(metavar="B", help="Folder of another map of the building.")],
    out: Annotated[Path, typer.Option(help="Folder for the joined map; made if need be.")],
    config: Files = None,
    settings: Settings = None,
) -> None:
    """Make one map of two of one building, floor by floor, found by WiFi and confirmed by the laser."""
    from wayfi.service.maps.merging import merge_maps

    with output.progress(f"merge {first} {second}"):
        found = merge_maps(first, second, out, configuration(config, settings))
    output.warn(found.warnings)
    merged, T = found.merged, found.merged.T_a_b
    output.say(
        f"{second} lies at {T.x:.2f} m, {T.y:.2f} m, {T.theta:.3f} rad in {first}: by WiFi at {merged.places} "
        f"places, by the laser at {merged.checks}, over {merged.spread_m:.0f} m: {out}"
    )
    if len(merged.building.floors) > 1:
        became = ", ".join(f"{own} is {number}" for own, number in sorted(merged.floors.items()))
        output.say(f"floors of {second} in {out}: {became}")
    result: dict[str, Any] = {**_named(out, found.name), "T_a_b": [T.x, T.y, T.theta], "floors": merged.floors}
    output.result(result | {"places": merged.places, "checks": merged.checks, "spread_m": merged.spread_m})


@command
def align(
    output: Output,
    map_path: Annotated[Path, typer.Argument(metavar="MAP", help="Folder of a saved map, or of results with one.")],
    fixes: Annotated[Path, typer.Option(help="TUM: where the robot was in the plan, at two moments or more.")],
    out: Annotated[Path | None, typer.Option(help="Folder for the aligned map; without, in place.")] = None,
    config: Files = None,
    settings: Settings = None,
) -> None:
    """Put a map into the frame of a floor plan."""
    from wayfi.recordings.files.tum import seconds_text
    from wayfi.service.maps.aligning import align_map

    with output.progress(f"align {map_path}"):
        found = align_map(map_path, fixes, out, configuration(config, settings))
    output.warn(found.warnings)
    T, alignment = found.alignment.T_plan_map, found.alignment
    residuals = alignment.residuals_m.tolist()
    rows = [
        [seconds_text(int(stamp_ns)), _metres(residual), "yes" if used else "no"]
        for stamp_ns, residual, used in zip(found.fixes.stamps_ns, residuals, alignment.used, strict=True)
    ]
    output.table("fixes", ["time", "off, m", "used"], rows)
    x, y, theta = (round(value, 4) + 0.0 for value in (T.x, T.y, T.theta))  # without a minus before zeros
    output.say(f"moved by {x:.3f} m, {y:.3f} m, {theta:.4f} rad: {out or map_path}")
    used = alignment.used.tolist()
    moved: dict[str, Any] = {"T_plan_map": [T.x, T.y, T.theta], "residuals_m": [_known(r) for r in residuals]}
    output.result({**_named(out or map_path, found.name), **moved, "used": used})


def _named(path: Path, name: "MapName") -> dict[str, Any]:
    return {"map": str(path), "map_id": name.map_id, "map_version": name.map_version}


def _print_closures(output: Output, found: "list[ListedClosure]", every: bool) -> None:
    from wayfi.recordings.files.tum import seconds_text

    rows = [
        [
            str(c.number), seconds_text(c.stamp_ns), f"{_metres(c.place[0])}, {_metres(c.place[1])}", c.kind, c.verdict,
            _metres(c.residual_m), c.reason,
        ]
        for c in found
        if every or c.verdict != "refused"
    ]  # fmt: skip
    output.table("closures", ["number", "time", "at, m", "kind", "verdict", "off, m", "reason"], rows)
    if len(rows) < len(found):
        output.say(f"{len(found) - len(rows)} that were refused are not shown (--all)")


def _without_nan(closure: "ListedClosure") -> dict[str, Any]:
    return {
        "number": closure.number,
        "stamp_ns": closure.stamp_ns,
        "x": _known(closure.place[0]),
        "y": _known(closure.place[1]),
        "kind": closure.kind,
        "verdict": closure.verdict,
        "residual_m": _known(closure.residual_m),
        "reason": closure.reason,
    }


def _known(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _metres(value: float) -> str:
    return "-" if math.isnan(value) else f"{value:.2f}"
