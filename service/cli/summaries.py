"""The summaries of results that commands print, as text and as JSON."""

import math
from dataclasses import asdict
from pathlib import Path
from typing import Any

from wayfi.service.cli.inspection_text import lines_of
from wayfi.service.evaluation.evaluate import Evaluation
from wayfi.service.maps.describing import MapDescription, words_of
from wayfi.service.process.console import Output
from wayfi.service.replay.diagnosis import Diagnosis


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


def print_evaluation(output: Output, directory: Path, evaluation: Evaluation) -> None:
    """Print the scores of a replay."""
    figures = evaluation.to_dict()
    rows = [
        [name, *(f"{figures[name][key]:.3f}" for key in ("ate_rmse_m", "ate_median_m", "ate_max_m"))]
        for name in ("final", "online")
    ]
    output.table("absolute trajectory error, m", ["", "RMSE", "median", "max"], rows)
    closures = [
        [kind, str(score["accepted"]), _figure_text(score["precision"]), _figure_text(score["nees"])]
        for kind, score in figures["closures"].items()
    ]
    output.table("loop closures", ["", "accepted", "precision", "NEES"], closures)
    output.say(f"plots and evaluation.json: {directory}")
    output.result(figures)


def print_diagnosis(output: Output, diagnosis: Diagnosis) -> None:
    """Print what a recording holds, the verdict, and what to type next."""
    for line in lines_of(diagnosis):
        output.say(line)
    if diagnosis.usable:
        output.result(diagnosis.to_dict())
    else:
        output.error(diagnosis.verdict, diagnosis.to_dict())


def print_map(output: Output, described: MapDescription) -> None:
    """Print what a saved map holds."""
    for line in words_of(described):
        output.say(line)
    output.result(asdict(described) | {"whole": described.whole})


def _figure_text(value: float | None) -> str:
    return "-" if value is None or math.isnan(value) else f"{value:.3f}"
