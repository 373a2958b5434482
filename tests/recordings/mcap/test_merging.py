"""A log time that was never set leaves a message where it is in the file; simulated time, which begins at 0, is set."""

from pathlib import Path

import pytest
from mcap_files import numbers, record, write

EPOCH_NS = 1_700_000_000_000_000_000


@pytest.mark.parametrize("flush_every", [1, 4, 100])
@pytest.mark.parametrize("unset", [{0}, {5}, {0, 1, 2}, {3, 4, 5, 6, 7, 8, 9}, {11}])
def test_unset_times_keep_the_order_of_the_file(tmp_path: Path, flush_every: int, unset: set[int]) -> None:
    records = [record(n, 0 if n in unset else EPOCH_NS + n) for n in range(12)]
    assert numbers(write(tmp_path / "a.mcap", records, flush_every=flush_every)) == list(range(12))


def test_simulated_time_begins_at_0(tmp_path: Path) -> None:
    records = [record(0, 5), record(1, 0), record(2, 7)]
    assert numbers(write(tmp_path / "a.mcap", records)) == [1, 0, 2]
