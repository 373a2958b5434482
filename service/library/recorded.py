"""Replays a recording, as `wayfi replay` does."""

import os

from wayfi.service.replay import replay as headless

from .arguments import path_of
from .compiling import compile_first
from .configuring import Given, files_of, settings_of
from .results import Result, load_result


def replay(
    recording: str | os.PathLike[str],
    out: str | os.PathLike[str],
    config: Given = None,
    rrd: bool = True,
    calibration: str | os.PathLike[str] | None = None,
    **settings: object,
) -> Result:
    """Replay `recording` into the folder `out`, with session.rrd if `rrd`; returns what is in the folder.

    `config` is a TOML file or nested mappings, `calibration` the calibration.toml of an earlier drive; `settings`
    override `config` by `section.key`. For a daemon's run folder, the configuration and the calibration in its black
    box apply where these say nothing. Raises WayfiError.
    """
    source, folder = path_of(recording, "recording"), path_of(out, "out")
    prior_file = None if calibration is None else path_of(calibration, "calibration")
    configured, prior = headless.settings_for(source, files_of(config), settings_of(config, settings), prior_file)
    compile_first()
    headless.replay(source, configured, prior, headless.ReplayOptions(folder, rrd=rrd))
    return load_result(folder)
