"""The summaries of results that commands print, as text and as JSON."""

import math
from dataclasses import asdict
from pathlib import Path

from wayfi.service.cli.inspection_text import lines_of
from wayfi.service.evaluation.evaluate import Evaluation
from wayfi.service.maps.describing import MapDescription, words_of
from wayfi.service.process.console import Output
from wayfi.service.replay.diagnosis import Diagnosis


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
