"""Tells when numba compiles instead of loading what it compiled before, so that it is not mistaken for a hang."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any


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
