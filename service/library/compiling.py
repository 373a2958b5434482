"""What is compiled at its first use is compiled before a drive begins, and the caller is told if that takes long."""

import logging

from wayfi.service.drive.warm_up import warm_up
from wayfi.service.process.compilation import watch_compilation

_LOG = logging.getLogger("wayfi")


def compile_first() -> None:
    """Compile or load all that a drive needs; the logger `wayfi` warns where it is not compiled yet."""
    with watch_compilation(_tell):
        warm_up()


def _tell(number: int, total: int) -> None:
    if number == 1:
        _LOG.warning("compiling %d functions, once: about half a minute (`wayfi warm-up` does it beforehand)", total)
