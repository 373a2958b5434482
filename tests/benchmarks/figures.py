"""What was measured of a case, as the cells of a table."""

import statistics
from collections import Counter
from collections.abc import Sequence
from typing import Any

from measuring import Measured

from wayfi.frontends.events import ClosureKind, Verdict
from wayfi.recordings.files.tables import ClosureRow
from wayfi.service.evaluation.trajectory_scores import RelationError

COLUMNS = [
    *("recording", "final ATE, m", "online ATE, m", "wheels ATE, m", "relations, all / on scans, m"),
    *("walls / by wheels, m^2", "WiFi closures", "LiDAR closures", "checks", "check ms, p50 / p99 / max", "CPU s"),
    *("times real time", "last tenth / first tenth", "peak MB", ".rrd MB", "stages, % of wall time"),
]
ACCURACY = 3  # the columns of ATE, after the recording
SHOWN_STAGES = 5


def cells(measured: Measured) -> list[str]:
    """A case's row; empty cells where there is nothing to measure by."""
    stages, report = measured.report["stages"], measured.report
    return [
        measured.case.title,
        *ates(measured),
        relations(measured.relations),
        " / ".join(f"{area:.2f}" for area in measured.wall_areas_m2 or ()),
        *(closures(measured, kind) for kind in (ClosureKind.WIFI, ClosureKind.LIDAR)),
        checks(measured.rows),
        check_ms(stages),
        f"{measured.cpu_s:.1f}",
        f"{report['recording_s'] / measured.wall_s:.0f}",
        f"{stages['process']['last_tenth_ms'] / stages['process']['first_tenth_ms']:.2f}",
        f"{report['peak_memory_mb']:.0f}",
        f"{measured.rrd_mb:.0f}",
        stage_shares(stages, measured.wall_s),
    ]


def median_cells(name: str, measured: Sequence[Measured]) -> list[str]:
    """The row of the medians of several seeds: only the ATEs."""
    columns = zip(*map(ates, measured), strict=True)
    medians = [f"{statistics.median(map(float, column)):.3f}" if all(column) else "" for column in columns]
    return [median_title(name), *medians, *[""] * (len(COLUMNS) - 1 - ACCURACY)]


def median_title(name: str) -> str:
    """What the row of the medians is called."""
    return f"{name}, median"


def ates(measured: Measured) -> list[str]:
    """The final ATE, the online one, and that of the wheels."""
    if measured.evaluation is None:
        return [""] * ACCURACY
    wheels = measured.wheels_ate_m
    errors = [score.alignment.error for score in (measured.evaluation.final, measured.evaluation.online)]
    return [*(f"{error.ate_rmse_m:.3f}" for error in errors), "" if wheels is None else f"{wheels:.3f}"]


def relations(errors: tuple[RelationError, RelationError] | None) -> str:
    """The mean translation error of the hand-checked relations, over all and where both ends are on scans."""
    return " / ".join(f"{error.translation_mean_m:.3f}" if error.scored else "none" for error in errors or ())


def closures(measured: Measured, kind: ClosureKind) -> str:
    """Accepted closures, and by a reference their precision and NEES."""
    accepted = sum(row.kind is kind and row.verdict is Verdict.ACCEPTED for row in measured.rows)
    if measured.evaluation is None or not accepted:
        return str(accepted)
    score = measured.evaluation.closures[kind]
    known = [(name, value) for name, value in (("p", score.precision), ("NEES", score.nees)) if value is not None]
    return ", ".join([str(accepted), *(f"{name} {value:.2f}" for name, value in known)])


def checks(rows: list[ClosureRow]) -> str:
    """How many checks by the laser there were, by their verdict at the end."""
    counts = Counter(row.verdict.value for row in rows if row.kind is ClosureKind.LIDAR)
    return ", ".join(f"{verdict} {n}" for verdict, n in sorted(counts.items()))


def check_ms(stages: dict[str, dict[str, float]]) -> str:
    """What a check by the laser took."""
    if "check" not in stages:
        return ""
    return " / ".join(f"{stages['check'][name]:.1f}" for name in ("p50_ms", "p99_ms", "max_ms"))


def stage_shares(stages: dict[str, Any], wall_s: float) -> str:
    """The stages that take longest, each without the stages inside it."""
    seconds = {name: stage["seconds"] for name, stage in stages.items()}
    inside = ("scan_points", "scan_matching", "backend", "wifi", "closure")
    seconds["process"] -= sum(seconds.get(name, 0.0) for name in inside)
    if "check" in seconds:
        seconds["closure"] -= seconds["check"]
    longest = sorted(seconds.items(), key=lambda item: -item[1])[:SHOWN_STAGES]
    return ", ".join(f"{name} {100 * s / wall_s:.0f}" for name, s in longest)
