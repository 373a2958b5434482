"""rosbag2 databases as they are left by what writes and trims them."""

import shutil
import sqlite3
from contextlib import closing
from pathlib import Path

import pytest

from wayfi.recordings.bags.sqlite_part import SqlitePart

ROWS = 700


def fill(database: sqlite3.Connection, first: int) -> None:
    """Fill in `ROWS` messages, numbered from `first`."""
    database.execute("CREATE TABLE topics(id INTEGER PRIMARY KEY, name, type, serialization_format)")
    database.execute("CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB)")
    database.execute("INSERT INTO topics VALUES (1, '/odom', 'nav_msgs/msg/Odometry', 'cdr')")
    rows = [(first + n, 1, 1_000 + n, bytes(8)) for n in range(ROWS)]
    database.executemany("INSERT INTO messages VALUES (?, ?, ?, ?)", rows)
    database.commit()


def stamps_of(part: SqlitePart) -> list[int]:
    return [record.log_time_ns for block in part.blocks for record in part.records(block)]


@pytest.mark.parametrize("first", [0, 1, 50_000_000, 2**62])
def test_rows_are_found_whatever_their_numbers(first: int, tmp_path: Path) -> None:
    """What is left of a large recording keeps its numbers."""
    path = tmp_path / "trimmed.db3"
    with closing(sqlite3.connect(path)) as database:
        fill(database, first)
    part = SqlitePart(path)
    assert stamps_of(part) == list(range(1_000, 1_000 + ROWS))
    assert part.warning is None


def test_rows_that_are_only_in_the_log_beside_the_database_are_read(tmp_path: Path) -> None:
    """A recorder that was killed leaves them there."""
    path, killed = tmp_path / "bag.db3", tmp_path / "killed.db3"
    with closing(sqlite3.connect(path)) as database:
        database.execute("PRAGMA journal_mode=WAL")
        database.execute("PRAGMA wal_autocheckpoint=0")
        fill(database, 1)
        shutil.copy(path, killed)
        shutil.copy(f"{path}-wal", f"{killed}-wal")
    assert killed.stat().st_size < ROWS * 8
    assert len(stamps_of(SqlitePart(killed))) == ROWS
