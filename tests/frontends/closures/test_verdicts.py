"""The book of verdicts: numbers in order, and a change keeps all but the verdict and its reason."""

import numpy as np

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.closures.verdicts import Verdicts
from wayfi.frontends.events import ClosureJudged, ClosureKind, Verdict

REFUSED = ClosureJudged(
    0, 1, 2, 3, 4, ClosureKind.WIFI, "fingerprint", 0.7, 0.1, np.nan, Pose2(), np.eye(3), False, Verdict.REFUSED, "no"
)


def test_candidates_are_numbered_and_their_verdicts_change() -> None:
    book = Verdicts()
    assert [book.enter(REFUSED).closure for _ in range(3)] == [0, 1, 2]
    changed = book.change(1, Verdict.ACCEPTED, "after all")
    assert changed is book[1]
    assert (changed.closure, changed.verdict, changed.reason) == (1, Verdict.ACCEPTED, "after all")
    assert (changed.stamp_a_ns, changed.keyframe_b) == (1, 4)
    assert [book[n].verdict for n in (0, 2)] == [Verdict.REFUSED] * 2
    assert len(book) == 3
