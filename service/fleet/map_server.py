"""Serves the files of saved maps on Zenoh: a map of several parts is fetched file by file, what has changed alone."""

from collections.abc import Callable, Mapping
from contextlib import ExitStack
from pathlib import Path

import zenoh

from wayfi.recordings.closing import Closing
from wayfi.recordings.files.map_folder import MANIFEST, PART, WHOLE_FILES
from wayfi.recordings.files.replaced_together import read_current
from wayfi.service.fleet.fleet_file import FLEET
from wayfi.service.process.log_lines import LogLines

SERVED = (MANIFEST, FLEET, *WHOLE_FILES)


class MapServer(Closing):
    """Answers queries of `key`/NAME/FILE with the files of the maps that `folders` gives by their names.

    A query of `**/FILE` is answered for each map. What cannot be read, as it is replaced just now, has no answer; where
    the folders cannot be told, the answer is an error, and the log says so once. A context manager; raises ZenohError.
    """

    def __init__(
        self, session: zenoh.Session, key: str, folders: Callable[[], Mapping[str, Path]], log: LogLines
    ) -> None:
        self._key, self._folders, self._log = key, folders, log
        self._told = ""
        with ExitStack() as opened:
            opened.enter_context(session.declare_queryable(f"{key}/*/*", self._answer))
            self._opened = opened.pop_all()

    def close(self) -> None:
        """Serve nothing any more."""
        self._opened.close()

    def _answer(self, query: zenoh.Query) -> None:
        file = str(query.key_expr).rpartition("/")[2]
        with query:
            if file not in SERVED and not PART.fullmatch(file):
                return
            try:
                folders = self._folders()
            except OSError as error:
                self._refuse(
                    query, f"{error.filename or self._key}: cannot be listed: {error.strerror}; no map is served"
                )
                return
            self._told = ""
            for name, folder in folders.items():
                _reply(query, f"{self._key}/{name}/{file}", folder, file)

    def _refuse(self, query: zenoh.Query, why: str) -> None:
        query.reply_err(why.encode())
        if self._told != why:
            self._log.warning("maps", text=why)
        self._told = why


def _reply(query: zenoh.Query, key: str, folder: Path, file: str) -> None:
    """Reply with a file, if it is asked for and can be read; folders of the user may have names that are no keys."""
    try:
        if query.key_expr.intersects(zenoh.KeyExpr(key)):
            query.reply(key, read_current(folder, file), encoding=zenoh.Encoding.APPLICATION_OCTET_STREAM)
    except (OSError, zenoh.ZError):
        return
