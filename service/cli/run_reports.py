"""The reports of replays and localisations that commands print. What scores a result is not loaded for them."""

from pathlib import Path
from typing import Any

from wayfi.service.process.console import Output


def print_replay(output: Output, out: Path, report: dict[str, Any]) -> None:
    """Print the report of a replay."""
    speed = report["recording_s"] / max(report["wall_s"], 1e-9)
    seconds, wall = report["recording_s"], report["wall_s"]
    output.say(f"{seconds:.0f} s replayed in {wall:.1f} s ({speed:.0f} times real time): {out}")
    _print_drops_and_warnings(output, report)
    output.result(report)


def print_localization(output: Output, out: Path, report: dict[str, Any]) -> None:
    """Print the report of a localisation: whether the robot was found, and how it stood at the end."""
    known = report["localization"]
    spent = ", ".join(f"{state} {seconds:.0f} s" for state, seconds in known["seconds"].items())
    found = known["found_after_s"]
    output.say(f"{spent}: {out}")
    output.say("never found in the map" if found is None else f"found in the map after {found:.1f} s")
    for last in report["status_changes"][-1:]:
        output.say(f"at the end {last['state']}: {last['reason']}")
    _print_drops_and_warnings(output, report)
    output.result(report)


def _print_drops_and_warnings(output: Output, report: dict[str, Any]) -> None:
    for topic, reasons in report["dropped"].items():
        dropped = ", ".join(f"{count} {reason}" for reason, count in reasons.items())
        output.say(f"dropped from {topic}: {dropped}")
    output.warn(report["warnings"])
