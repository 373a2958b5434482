"""Where numba keeps what it compiles, and when it does so instead of loading it: not to be mistaken for a hang."""

import atexit
import os
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any


def ensure_cache() -> None:
    """Let numba keep what it compiles as long as this process lasts, where it can keep it nowhere else.

    Where neither the sources' folder nor the user's cache can be written, importing it would fail: call this before.
    """
    user = os.environ.get("XDG_CACHE_HOME") or os.path.join(os.path.expanduser("~"), ".cache")
    if "NUMBA_CACHE_DIR" in os.environ or any(map(_can_be_written, (Path(__file__).parent, Path(user)))):
        return
    folder = tempfile.TemporaryDirectory(prefix="wayfi-compiled-")
    atexit.register(folder.cleanup)
    os.environ["NUMBA_CACHE_DIR"] = folder.name


def _can_be_written(folder: Path) -> bool:
    there = next(path for path in (folder, *folder.parents) if os.path.exists(path))
    return os.access(there, os.W_OK | os.X_OK)


@contextmanager
def watch_compilation(tell: Callable[[int, int], None]) -> Iterator[None]:
    """Call `tell(n, m)` as the n-th of wayfi's functions is compiled, of the m that are imported by then."""
    from numba.core import event

    with event.install_listener("numba:compile", _listener(tell)):
        yield


def _listener(tell: Callable[[int, int], None]) -> Any:  # noqa: ANN401 - numba has no types
    from numba.core import event

    class Listener(event.Listener):
        def __init__(self) -> None:
            self._compiled: set[Any] = set()

        def on_start(self, compiled: Any) -> None:  # noqa: ANN401
            function = compiled.data["dispatcher"].py_func
            if function.__module__.startswith("wayfi.") and function not in self._compiled:
                self._compiled.add(function)
                tell(len(self._compiled), max(_known(), len(self._compiled)))

        def on_end(self, compiled: Any) -> None:  # noqa: ANN401
            pass

    return Listener()


def _known() -> int:
    """How many functions of the imported modules numba compiles."""
    from numba.core.dispatcher import Dispatcher

    ours = [module for name, module in sys.modules.items() if name.startswith("wayfi.")]
    return len({id(f) for module in ours for f in vars(module).values() if isinstance(f, Dispatcher)})
