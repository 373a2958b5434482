"""`wayfi warm-up`: all that numba compiles for a drive, compiled beforehand."""

import time

from wayfi.service.drive.warm_up import warm_up
from wayfi.service.process.compilation import watch_compilation
from wayfi.service.process.console import Output


def run_warm_up(output: Output) -> None:
    """Compile what is not compiled yet, and say how many functions that were."""
    compiled: list[int] = []
    start_s = time.monotonic()
    with output.progress("warm up"), watch_compilation(lambda number, _: compiled.append(number)):
        warm_up()
    seconds = time.monotonic() - start_s
    output.say(
        f"{len(compiled)} functions compiled in {seconds:.0f} s" if compiled else "everything is compiled already"
    )
    output.result({"compiled": len(compiled), "seconds": round(seconds, 3)})
