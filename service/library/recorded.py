"""A recording into a result, as `wayfi replay` does it."""

from pathlib import Path

from wayfi.service.replay import replay as headless

from .compiling import compile_first
from .configuring import Given, files_of, settings_of
from .results import Result, load_result


def replay(
    recording: str | Path,
    out: str | Path,
    config: Given = None,
    rrd: bool = True,
    calibration: str | Path | None = None,
    **settings: object,
) -> Result:
    """Replay `recording` into the folder `out`, with session.rrd if `rrd`; returns what is in the folder.

    `config` is a TOML file, `calibration` the calibration.toml of an earlier drive, `settings` are by `section.key`;
    what they leave out of a daemon's run is as its black box says. Raises WayfiError.
    """
    prior_file = None if calibration is None else Path(calibration)
    configured, prior = headless.settings_for(Path(recording), files_of(config), settings_of(settings), prior_file)
    compile_first()
    headless.replay(Path(recording), configured, prior, headless.ReplayOptions(Path(out), rrd=rrd))
    return load_result(out)
