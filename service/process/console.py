"""The output of a command: progress and errors on stderr, its result on stdout, as text or as one JSON object."""

import json
import os
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn
from rich.table import Table

from wayfi.service.process.compilation import watch_compilation


@dataclass(frozen=True)
class Output:
    """Prints a command's output. With `quiet` only errors; with `as_json` stdout is one JSON object."""

    quiet: bool = False
    as_json: bool = False
    _out: Console = field(default_factory=lambda: Console(highlight=False, soft_wrap=True))
    _err: Console = field(default_factory=lambda: Console(stderr=True, highlight=False))

    @contextmanager
    def progress(self, title: str) -> Iterator[Callable[[float], None]]:
        """A bar on stderr while something long runs; call what this yields with the fraction done, 0 to 1.

        While numba compiles, the bar says so; without a terminal one line does.
        """
        columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeElapsedColumn())
        heard = not (self.quiet or self.as_json)
        drawn = heard and self._err.is_terminal
        with Progress(*columns, console=self._err, transient=True, disable=not drawn) as bar:
            task = bar.add_task(title, total=1.0)

            def tell(number: int, total: int) -> None:
                bar.update(task, description=f"compiling, once: {number} of {total}")
                if heard and not drawn and number == 1:
                    self._err.print(f"compiling {total} functions, once: about half a minute", soft_wrap=True)

            with watch_compilation(tell):
                yield lambda fraction: bar.update(task, description=title, completed=fraction)

    def say(self, text: str) -> None:
        """A line for a person."""
        if not (self.quiet or self.as_json):
            self._out.print(text, markup=False)

    def warn(self, warnings: Iterable[str]) -> None:
        """A line for each."""
        for warning in warnings:
            self.say(f"warning: {warning}")

    def table(self, title: str, columns: list[str], rows: list[list[str]]) -> None:
        """A table for a person."""
        if self.quiet or self.as_json:
            return
        table = Table(*columns, title=title, title_justify="left", box=None, pad_edge=False)
        for row in rows:
            table.add_row(*row)
        self._out.print(table)

    def result(self, value: Mapping[str, Any]) -> None:
        """The command's result, where --json asks for it."""
        if self.as_json:
            print(json.dumps(value), flush=True)  # noqa: T201 - stdout is the interface

    def error(self, text: str, found: Mapping[str, Any] | None = None) -> None:
        """One line that says what is wrong; `found` is told besides where --json asks for the result."""
        self._err.print(f"wayfi: {text}", markup=False, soft_wrap=True)
        try:
            self.result({**(found or {}), "error": text})
        except OSError:
            close_stdout()


def close_stdout() -> None:
    """Discard what is still to be printed: standard output cannot be written, and Python would fail at its exit."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
