"""What was measured of an experiment, as the cells of a table."""

from collections.abc import Sequence

import numpy as np
from benchmarks.localization.scoring import End, Score

COLUMNS = [
    *("experiment", "starts", "found in 5 / 10 / 30 s, %", "found at all, %", "seconds, median / p90"),
    *("right after, %", "end right / off / false / nothing", "runs with a false claim (TRACKING)"),
    *("false claims, of all (TRACKING)", "TRACKING, not right", "worst, m", "CPU, s a run / longest, ms"),
]
WITHIN_S = (5.0, 10.0, 30.0)
NOWHERE_M = 1e5


def cells(name: str, scores: Sequence[Score], cpu: Sequence[tuple[float, float]]) -> list[str]:
    """The row of an experiment; `cpu` are the seconds and the longest milliseconds of each run."""
    found = np.array([np.inf if s.found_s is None else s.found_s for s in scores])
    ends = [sum(s.end is end for s in scores) for end in (End.RIGHT, End.OFF, End.FALSE, End.NOTHING)]
    claims, false = sum(s.claims for s in scores), sum(s.false for s in scores)
    after = [s.right_after for s in scores if s.found_s is not None]
    return [
        name,
        str(len(scores)),
        " / ".join(f"{100 * np.mean(found <= within):.0f}" for within in WITHIN_S),
        f"{100 * np.mean(np.isfinite(found)):.0f}",
        " / ".join(seconds(found, share) for share in (0.5, 0.9)),
        f"{100 * np.mean(after):.0f}" if after else "",
        " / ".join(map(str, ends)),
        f"{sum(s.false > 0 for s in scores)} ({sum(s.false_tracking > 0 for s in scores)})",
        f"{false} of {claims} ({sum(s.false_tracking for s in scores)})",
        str(sum(s.off_tracking for s in scores)),
        worst(scores),
        f"{np.mean([s for s, _ in cpu]):.1f} / {max(ms for _, ms in cpu):.0f}",
    ]


def seconds(found: "np.typing.NDArray[np.float64]", share: float) -> str:
    """The seconds within which `share` of all runs, those that never found it included, found it."""
    value = float(np.quantile(found, share, method="inverted_cdf"))
    return f"{value:.1f}" if np.isfinite(value) else "never"


def worst(scores: Sequence[Score]) -> str:
    """The largest error of all claims, m; of claims in the map of another building it means nothing."""
    metres = max((s.worst_m for s in scores), default=0.0)
    return f"{metres:.2f}" if metres < NOWHERE_M else "elsewhere"
