"""A rosbag2 database (.db3), as far as it can be read."""

import sqlite3
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any
from urllib.parse import quote

from wayfi.recordings.bags.bag_part import BagPart
from wayfi.recordings.mcap.blocks import Block, Record, RecordingError
from wayfi.recordings.ros.topics import Channel

MAGIC = b"SQLite format 3\0"
_ROWS_OF_A_BLOCK = 100
_SMALLEST_ROW_BYTES = 8
_LAST_ROW = 2**63 - 1  # that SQLite numbers
_COLUMNS = "id, topic_id, timestamp"

Row = tuple[Any, ...]


class SqlitePart(BagPart):
    """The messages of the database at `path`, in blocks of consecutive rows.

    Raises RecordingError if its topics cannot be read.
    """

    profile = "ros2"

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self._damage = ""
        self._topics: dict[int, Channel] = {}
        try:
            with closing(self._open()) as database:
                topics = database.execute("SELECT id, name, type, serialization_format FROM topics").fetchall()
                self._topics = {number: Channel(*map(str, channel)) for number, *channel in topics}
                self._add_blocks([row for row in self._rows(database, _COLUMNS) if _is_sound(row, self._topics)])
        except sqlite3.Error as error:
            raise RecordingError(f"{path} is no rosbag2 database that can be read: {error}") from None

    @property
    def warning(self) -> str | None:
        """What was found so far to be damaged, in one line."""
        if not self._damage:
            return None
        return f"{self.path.name} is damaged or cut off ({self._damage}); used the {self.counts.total()} messages left"

    def records(self, block: Block) -> list[Record]:
        """The messages of `block` in the order of the database."""
        try:
            with closing(self._open()) as database:
                rows = [*self._rows(database, f"{_COLUMNS}, data", block.offset, block.offset + block.length)]
        except sqlite3.Error as error:
            self._damage = self._damage or str(error)
            return []
        sound = [row for row in rows if _is_sound(row, self._topics) and isinstance(row[3], bytes)]
        return [Record(*self._topics[topic], log_time_ns, data) for _, topic, log_time_ns, data in sound]

    def _open(self) -> sqlite3.Connection:
        """The database, read only; a log of changes beside it that cannot be read is ignored."""
        address = f"file:{quote(str(self.path.resolve()))}?mode=ro"
        database = sqlite3.connect(address, uri=True)
        try:
            database.execute("PRAGMA writable_schema=ON")  # else a database shorter than it says is refused
            database.execute("SELECT count(*) FROM sqlite_master").fetchall()
        except sqlite3.Error:
            database.close()
            database = sqlite3.connect(f"{address}&immutable=1", uri=True)
            database.execute("PRAGMA writable_schema=ON")
        return database

    def _rows(
        self, database: sqlite3.Connection, columns: str, first: int = 0, end: int | None = None
    ) -> Iterator[Row]:
        """The rows from `first` up to `end`, each once; behind one that cannot be read, the next one that can.

        Every step goes on, twice as far as the one before, so that no damage makes it endless.
        """
        query = f"SELECT {columns} FROM messages WHERE id >= ? AND id < ? ORDER BY id"
        end = self._end_of_rows(database) if end is None else end
        following, skipped = first, 0
        while following + skipped < end:
            try:
                for row in database.execute(query, (following + skipped, end)):
                    if not following + skipped <= row[0] < end:
                        raise sqlite3.DatabaseError("rows are not in order")
                    yield row
                    following, skipped = row[0] + 1, 0
            except sqlite3.DatabaseError as error:
                self._damage = self._damage or str(error)
                skipped = 2 * skipped or 1
            else:
                return

    def _end_of_rows(self, database: sqlite3.Connection) -> int:
        """A number beyond those of the rows, which may be in the log beside the file, or those of a larger file."""
        room = self.path.stat().st_size // _SMALLEST_ROW_BYTES
        try:
            (last,) = database.execute("SELECT max(id) FROM messages").fetchone()
        except sqlite3.DatabaseError:
            return room
        return min(max(room, last + 1), _LAST_ROW) if isinstance(last, int) else room

    def _add_blocks(self, rows: list[Row]) -> None:
        for at in range(0, len(rows), _ROWS_OF_A_BLOCK):
            some = rows[at : at + _ROWS_OF_A_BLOCK]
            times_ns = [row[2] for row in some]
            self.blocks.append(Block(some[0][0], some[-1][0] + 1 - some[0][0], min(times_ns), max(times_ns)))
        self.counts.update(self._topics[row[1]] for row in rows)


def _is_sound(row: Row, topics: dict[int, Channel]) -> bool:
    return row[1] in topics and isinstance(row[2], int) and 0 <= row[2] < 2**64
