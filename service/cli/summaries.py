"""The summaries of results that commands print, as text and as JSON."""

import math
from pathlib import Path
from typing import Any

from wayfi.recordings.inspection import Inspection
from wayfi.service.evaluation.evaluate import Evaluation
from wayfi.service.process.console import Output


def print_replay(output: Output, out: Path, report: dict[str, Any]) -> None:
    """Print the report of a replay."""
    speed = report["recording_s"] / max(report["wall_s"], 1e-9)
    seconds, wall = report["recording_s"], report["wall_s"]
    output.say(f"{seconds:.0f} s replayed in {wall:.1f} s ({speed:.0f} times real time): {out}")
    for topic, reasons in report["dropped"].items():
        dropped = ", ".join(f"{count} {reason}" for reason, count in reasons.items())
        output.say(f"dropped from {topic}: {dropped}")
    for warning in report["warnings"]:
        output.say(f"warning: {warning}")
    output.result(report)


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


def print_inspection(output: Output, inspection: Inspection) -> None:
    """Print the contents of a recording."""
    output.say(f"{inspection.path}: {inspection.duration_s:.1f} s, {inspection.message_count} messages")
    rows = [
        [
            topic.topic,
            topic.type_name,
            str(topic.count),
            "-" if topic.rate_hz is None else f"{topic.rate_hz:.1f} Hz",
            "-" if topic.longest_gap_s is None else f"{topic.longest_gap_s:.1f} s",
            f"{topic.time_faults.jumps_back} back, {topic.time_faults.duplicates} twice",
            topic.why,
        ]
        for topic in inspection.topics
    ]
    output.table("", ["topic", "type", "messages", "rate", "longest gap", "time faults", ""], rows)
    for warning in inspection.warnings:
        output.say(f"warning: {warning}")
    output.result(inspection.to_dict())


def _figure_text(value: float | None) -> str:
    return "-" if value is None or math.isnan(value) else f"{value:.3f}"
