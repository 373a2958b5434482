"""Replay: a recording through the pipeline, headless, lossless and deterministic, into a folder of results."""

import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from wayfi.backend.errors import WayfiError
from wayfi.frontends.calibration import Calibration
from wayfi.frontends.measurements import Sensor
from wayfi.frontends.result import DriveEstimate
from wayfi.recordings.bags.opening import open_any_recording
from wayfi.recordings.files.calibration_file import parse_calibration, read_calibration
from wayfi.recordings.files.result_folder import ResultFolder
from wayfi.recordings.log import Log, NullLog
from wayfi.recordings.mcap.parts import BLACKBOX, parts_of
from wayfi.recordings.mcap.recording import Recording
from wayfi.recordings.rerun.log_process import LogProcess, Part
from wayfi.service.blackbox.blackbox import CALIBRATION, CONFIG, MAP
from wayfi.service.config import Config, load_config
from wayfi.service.drive.drive import Drive
from wayfi.service.drive.known_map import KnownMap, MapReference
from wayfi.service.drive.live_drive import LiveDrive
from wayfi.service.drive.mode import Mode
from wayfi.service.drive.results import Source, write_results
from wayfi.service.drive.warm_up import warm_up
from wayfi.service.process.collection import loaded_objects_left_alone
from wayfi.service.process.stop_signal import StopSignal
from wayfi.service.replay.found_topics import with_found_topics
from wayfi.service.replay.playback_rate import PlaybackRate
from wayfi.service.replay.replayers import BlackBoxReplayer, PlainReplayer, Replayer

Progress = Callable[[float], None]


class ReplayError(WayfiError):
    """A recording that nothing can be made of."""


@dataclass(frozen=True, slots=True)
class ReplayOptions:
    """Where the results go; `rate` times real time, None as fast as it goes; whether session.rrd is written.

    The drive goes on with the saved map at `known_map`, if one is given.
    """

    out: Path
    rate: float | None = None
    rrd: bool = True
    known_map: Path | None = None


def settings_for(
    recording_path: Path, files: Sequence[Path], settings: Sequence[str], calibration_path: Path | None
) -> tuple[Config, Calibration | None]:
    """The configuration and calibration to replay a recording with: a black box's own, unless told otherwise.

    Raises RecordingError, ConfigError or CalibrationError.
    """
    load_config(files, settings)  # wrong usage is told before a wrong recording
    recording = open_any_recording(recording_path)
    kept = recording.attachments() if recording.is_blackbox else {}
    config = load_config(files, settings, kept.get(CONFIG, b"").decode(errors="replace"))
    if calibration_path is not None:
        return config, read_calibration(calibration_path)
    if CALIBRATION not in kept:
        return config, None
    return config, parse_calibration(kept[CALIBRATION].decode(errors="replace"), f"{recording_path}: {CALIBRATION}")


def replay(
    recording_path: Path,
    config: Config,
    calibration: Calibration | None,
    options: ReplayOptions,
    progress: Progress = lambda _: None,
) -> dict[str, Any]:
    """Replay a recording; returns the report. Raises RecordingError or ReplayError where nothing usable is in it.

    The results in `options.out` are either all of this replay or, where it raises, those that were there before. Raises
    ResultError where they cannot be written, and MapError where the map to go on with cannot be loaded.
    """
    known = MapReference.of(options.known_map, Mode.MAPPING).load() if options.known_map else None

    def begin(recording: Recording, config: Config, log: Log) -> Replayer:
        return replayer_of(recording, config, calibration, log, known)

    return play_to_results(recording_path, config, options, begin, write_results, progress)


def play_to_results(
    recording_path: Path,
    config: Config,
    options: ReplayOptions,
    begin: Callable[[Recording, Config, Log], Replayer],
    write: Callable[[Path, Drive, DriveEstimate, Source], dict[str, Any]],
    progress: Progress,
) -> dict[str, Any]:
    """Play a recording into what `begin` returns, and `write` what comes of it; returns what `write` does.

    Raises as `replay` does.
    """
    start = time.perf_counter()
    recording = open_any_recording(recording_path)
    config, sought = with_found_topics(config, recording)
    with _result_folder(options.out, recording) as folder:
        sha256 = recording.sha256()
        replayer = begin(recording, config, _open_log(config, options.rrd, folder.log, sha256[:16]))
        playback = PlaybackRate(options.rate)
        result = _run(recording, replayer, playback, progress)
        if _never_began(result, replayer.drive) or _stands_still(result, replayer.drive):
            raise ReplayError(_nothing_usable(recording_path, replayer.drive, sought, replayer.unused))
        warnings = recording.warnings + sought + playback.warnings
        warnings += [f"{topic}: not used: {why}" for topic, why in replayer.unused.items()]
        source = Source(time.perf_counter() - start, playback.played_s, sha256, warnings)
        return write(folder.staged, replayer.drive, result, source)


def _result_folder(out: Path, recording: Recording) -> ResultFolder:
    """The folder of the results. Raises ReplayError where that is the folder of another recording's run."""
    if parts_of(out, BLACKBOX) and out.resolve() not in {path.resolve().parent for path in recording.paths}:
        raise ReplayError(f"{out}: holds the black box of another run; name another folder")
    return ResultFolder(out, recording.paths)


def _run(recording: Recording, replayer: Replayer, playback: PlaybackRate, progress: Progress) -> DriveEstimate:
    """Play all of the recording; returns the result. The log is closed whatever happens: it holds what led there."""
    try:
        with StopSignal() as stop:  # an interrupt within compiled code would look like its failure
            warm_up(replayer.drive.begins_in_map)  # else the first tenth of the drive would pay for what is loaded once
            with loaded_objects_left_alone():
                _play_all(recording, replayer, playback, progress, stop)
        return replayer.drive.finish()
    except BaseException:
        replayer.drive.log.close()
        raise


def replayer_of(
    recording: Recording, config: Config, calibration: Calibration | None, log: Log, known: KnownMap | None = None
) -> Replayer:
    """What plays the recording's records, in their order, into a drive that goes on with the `known` map, if any."""
    if recording.is_blackbox:
        return BlackBoxReplayer(LiveDrive(config, calibration, log, known or _map_of(recording)))
    if known is None:
        return PlainReplayer(Drive(config, calibration, log))
    drive = Drive(config, calibration, log, known.building, extends=True)
    drive.former = known.name
    return PlainReplayer(drive)


def _map_of(recording: Recording) -> KnownMap | None:
    """The map that a black box's drive began in, if it did. Raises MapError where that is not there any more."""
    named = recording.attachments().get(MAP)
    return MapReference.parse(named, f"{recording.path}: {MAP}").load() if named else None


def _play_all(
    recording: Recording, replayer: Replayer, playback: PlaybackRate, progress: Progress, stop: StopSignal
) -> None:
    total = max(recording.message_count, 1)
    for number, record in enumerate(recording):
        playback.wait_for(record.log_time_ns, lambda: stop.requested)
        if stop.requested:
            raise KeyboardInterrupt
        replayer.play(record)
        if number % 100 == 0:
            progress(number / total)
    progress(1.0)


def _open_log(config: Config, rrd: bool, path: Path, recording_id: str) -> Log:
    if rrd and config.rerun.enabled:
        return LogProcess(Part(config.rerun, path, recording_id))
    return NullLog()


def _never_began(result: DriveEstimate, drive: Drive) -> bool:
    """Whether no message has moved the robot; without poses it may still have moved, unknown where in its map."""
    return len(result.stamps_ns) == 0 and drive.pipeline.stamp_ns == 0


def _stands_still(result: DriveEstimate, drive: Drive) -> bool:
    """Whether nothing but the first odometry has been used, and all that followed was dropped."""
    odometry = drive.config.recording.every_topic[Sensor.ODOM]
    return len(result.stamps_ns) == 1 and any(topic in drive.counters.dropped for topic in odometry)


def _nothing_usable(path: Path, drive: Drive, sought: list[str], unused: dict[str, str]) -> str:
    dropped = Counter({f"{t} {r}": n for t, reasons in drive.counters.dropped.items() for r, n in reasons.items()})
    why = drive.counters.warnings + sought + [f"{topic} ({reason})" for topic, reason in unused.items()]
    why += [f"{n} x {what}" for what, n in dropped.items()]
    topics = drive.config.recording.every_topic
    wanted = " or ".join(topics[Sensor.ODOM] + topics[Sensor.SCAN])
    return f"{path}: nothing usable on {wanted}; see `wayfi inspect`" + (f": {'; '.join(why)}" if why else "")
