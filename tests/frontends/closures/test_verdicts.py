"""The book of verdicts: numbers in order, and a change keeps all but the verdict and its reason."""

from dataclasses import replace

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


def test_a_moved_keyframe_changes_the_stamps_of_its_own_verdicts_alone() -> None:
    """Those of a map may have the same stamps: the drive may be the one that made it."""
    book = Verdicts()
    for a, b in ((3, 4), (13, 14)):
        book.enter(replace(REFUSED, keyframe_a=a, keyframe_b=b))
    assert [event.closure for event in book.move_stamps({14: 7})] == [1]
    assert [(book[n].stamp_a_ns, book[n].stamp_b_ns) for n in (0, 1)] == [(1, 2), (1, 7)]
