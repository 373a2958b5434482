"""`wayfi localize`: a recording through the pipeline in a map that stays as it is."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from wayfi.frontends.calibration import Calibration
from wayfi.frontends.measurements import SECOND_NS
from wayfi.frontends.result import DriveEstimate
from wayfi.recordings.log import Log
from wayfi.recordings.map.loading import LoadedMap, load_map
from wayfi.recordings.mcap.recording import Recording
from wayfi.service.config import Config
from wayfi.service.drive.drive import Drive
from wayfi.service.drive.results import Source, write_results_in_map
from wayfi.service.replay.replay import Progress, ReplayError, ReplayOptions, play_to_results
from wayfi.service.replay.replayers import PlainReplayer, Replayer


def localize(
    recording_path: Path,
    map_path: Path,
    config: Config,
    calibration: Calibration | None,
    options: ReplayOptions,
    progress: Progress = lambda _: None,
) -> dict[str, Any]:
    """Localise a recording in the map at `map_path`, with no initial pose; returns the report.

    `map_path` is the folder of a map, or results with a map. Raises MapError where there is none that can be loaded,
    RecordingError or ReplayError where nothing usable is in the recording, and ResultError where the results cannot be
    written. The results hold no map of their own; earlier results in `options.out` stay whole until they are.
    """
    known = load_map(map_path)
    if options.out.resolve() in (known.folder.resolve(), known.folder.resolve().parent):
        raise ReplayError(f"{options.out}: holds the map itself, which the results would replace; name another folder")

    def begin(recording: Recording, config: Config, log: Log) -> Replayer:  # noqa: ARG001 - as a replay's
        return PlainReplayer(Drive(config, calibration, log, known.building))

    def write(directory: Path, drive: Drive, estimate: DriveEstimate, source: Source) -> dict[str, Any]:
        extra = {"localization": summary(known, drive, estimate)}
        told = replace(source, warnings=[*known.warnings, *source.warnings])
        return write_results_in_map(directory, drive, estimate, told, extra)

    return play_to_results(recording_path, config, options, begin, write, progress)


def summary(known: LoadedMap, drive: Drive, estimate: DriveEstimate) -> Mapping[str, Any]:
    """What the report says of a localisation: the map, when a pose was first claimed, seconds in each state."""
    changes, end_s = drive.counters.status_changes, drive.pipeline.stamp_ns / SECOND_NS
    until = [change["stamp"] for change in changes[1:]] + [end_s]
    seconds: dict[str, float] = {}
    for change, end in zip(changes, until, strict=True):
        seconds[change["state"]] = seconds.get(change["state"], 0.0) + end - change["stamp"]
    first_s = int(estimate.stamps_ns[0]) / SECOND_NS if len(estimate.stamps_ns) else None
    return {
        "map_id": known.map_id,
        "map_version": known.map_version,
        "claimed_poses": len(estimate.stamps_ns),
        "found_after_s": None if first_s is None else round(first_s - changes[0]["stamp"], 3),
        "seconds": {state: round(value, 3) for state, value in seconds.items()},
    }
