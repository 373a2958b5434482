"""Writes the files of a drive: every one always exists."""

import hashlib
import json
import platform
import resource
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

from wayfi.frontends.maps.building_map import BuildingMap
from wayfi.frontends.result import DriveEstimate
from wayfi.recordings.files.atomic_files import write_text
from wayfi.recordings.files.calibration_file import write_calibration
from wayfi.recordings.files.g2o import write_g2o
from wayfi.recordings.files.map_files import write_map
from wayfi.recordings.files.result_folder import MAP
from wayfi.recordings.files.tables import RadioPlace, write_closures, write_radio
from wayfi.recordings.files.tum import write_tum
from wayfi.recordings.map.saving import MapSaver
from wayfi.service.config import config_toml
from wayfi.service.drive.drive import Drive

HASHED_AT_ONCE_BYTES = 1 << 20
PACKAGES = ("wayfi", "gtsam", "numpy", "scipy", "numba", "kiss-icp", "mcap", "rerun-sdk", "rosbags")


@dataclass(frozen=True, slots=True)
class Source:
    """The source of a drive: seconds that reading it took, seconds recorded, its hash in hexadecimal, its warnings."""

    wall_s: float
    recording_s: float
    sha256: str
    warnings: list[str]


def write_results(
    directory: Path,
    drive: Drive,
    estimate: DriveEstimate,
    source: Source,
    extra: Mapping[str, Any] | None = None,
    saver: MapSaver | None = None,
) -> dict[str, Any]:
    """Write every file of a drive into `directory`; returns the report, with `extra` added. Raises OSError, MapError.

    `saver` saves the map, where it has done so on the way. A drive that localises has no map of its own to save.
    """
    building = estimate.building
    with drive.timer("files"):
        _write_estimate(directory, estimate)
        write_closures(directory / "closures.csv", drive.counters.verdicts.values())
        write_radio(directory / "radio.csv", _radio(building))
        write_text(directory / "config.toml", config_toml(drive.config))
        write_calibration(directory / "calibration.toml", building.calibration)
        for floor, grid in building.grids.items():
            write_map(directory, grid, drive.config.map, estimate.path_on(floor), floor)
        if drive.makes_map:
            former, known = (None, None) if estimate.is_separate else (drive.former, saver)
            (known or MapSaver(directory / MAP, drive.config.map, former, drive.config.frames)).save(building)
    report = report_of(drive, source) | dict(extra or {})
    write_text(directory / "report.json", json.dumps(report, indent=1) + "\n")
    return report


def hash_of(paths: Sequence[Path]) -> str:
    """The SHA-256 of the files' bytes, one after another, in hexadecimal."""
    digest = hashlib.sha256()
    for path in paths:
        with path.open("rb") as file:
            while data := file.read(HASHED_AT_ONCE_BYTES):
                digest.update(data)
    return digest.hexdigest()


def _write_estimate(directory: Path, estimate: DriveEstimate) -> None:
    write_tum(directory / "trajectory.tum", estimate.stamps_ns, estimate.final)
    published = estimate.published
    write_tum(directory / "online.tum", estimate.stamps_ns[published], estimate.online[published])
    building = estimate.building
    write_g2o(directory / "graph.g2o", building.poses, building.factors.values(), building.calibration.wheels.values)


def _radio(building: BuildingMap) -> Iterator[RadioPlace]:
    for f, pose in zip(building.fingerprints, building.fingerprint_poses(), strict=True):
        yield RadioPlace(f.stamp_ns, float(pose[0]), float(pose[1]), f.receiver, f.readings.bssids, f.readings.rssi)


def _peak_memory_mb() -> float:
    """The peaks of this process and of the one that logs, added, MB.

    On Linux getrusage's peak of a process includes that of its parent at the fork; VmHWM does not.
    """
    kinds = (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    own_kb, logging_kb = (resource.getrusage(kind).ru_maxrss for kind in kinds)
    status = Path("/proc/self/status")
    if status.exists():
        own_kb = next(int(line.split()[1]) for line in status.read_text().splitlines() if line.startswith("VmHWM"))
    return (own_kb + logging_kb) / 1024


def report_of(drive: Drive, source: Source) -> dict[str, Any]:
    """What report.json says of a drive."""
    counters = drive.counters
    return {
        "messages": dict(counters.messages),
        "dropped": {topic: dict(reasons) for topic, reasons in counters.dropped.items()},
        "stages": drive.timer.report(),
        "wall_s": round(source.wall_s, 3),
        "recording_s": round(source.recording_s, 3),
        "peak_memory_mb": round(_peak_memory_mb(), 1),
        "recording_sha256": source.sha256,
        "versions": {"python": platform.python_version(), **{name: version(name) for name in PACKAGES}},
        "warnings": source.warnings + counters.warnings,
        "status_changes": counters.status_changes,
        "floor": counters.floor,
    }
