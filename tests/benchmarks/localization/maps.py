"""The maps that are localised in: each made once by replaying a drive, and kept with where it lies in truth."""

import os
import pickle
from dataclasses import dataclass, fields
from pathlib import Path

from benchmarks.localization.drives import Drive, records, stream

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.maps.building_map import BuildingMap
from wayfi.frontends.pipeline import Pipeline
from wayfi.frontends.slam_config import SlamConfig
from wayfi.recordings.files.tum import read_tum, write_tum
from wayfi.recordings.trajectory import Trajectory
from wayfi.service.evaluation.trajectory_scores import absolute_error

FOREVER_NS = 1 << 62


@dataclass(frozen=True)
class KnownMap:
    """A map, and where its frame is in that of the truth."""

    building: BuildingMap
    T_truth_map: Pose2
    ate_m: float

    @property
    def bssids(self) -> list[str]:
        """The addresses of the access points that it knows, sorted."""
        return sorted({bssid for f in self.building.fingerprints for bssid in f.readings.bssids})


def map_of(kept: Path, drive: Drive, until_ns: int = FOREVER_NS, config: SlamConfig | None = None) -> KnownMap:
    """The map that `drive` makes until `until_ns`: kept as `kept`/NAME.pickle and NAME.tum, made if they are not there.

    A kept map that does not fit the program any more is made anew.
    """
    name = drive.name if until_ns == FOREVER_NS else f"{drive.name}-first"
    pickled, trajectory = kept / f"{name}.pickle", kept / f"{name}.tum"
    building = _kept(pickled) if trajectory.exists() else None
    if building is None:
        building = _make(drive, until_ns, config or SlamConfig(), trajectory)
        _keep(pickled, building)
    fitted = absolute_error(read_tum(trajectory), before(drive.truth, until_ns))
    return KnownMap(building, fitted.T_reference_estimate, fitted.error.ate_rmse_m)


def before(truth: Trajectory, until_ns: int) -> Trajectory:
    """The truth before a moment."""
    kept = truth.stamps_ns < until_ns
    return Trajectory(truth.stamps_ns[kept], truth.poses[kept])


def _make(drive: Drive, until_ns: int, config: SlamConfig, trajectory: Path) -> BuildingMap:
    pipeline = Pipeline(config)
    for measurement in stream(records(drive.recording), 0, until_ns):
        pipeline.process(measurement)
    estimate, _ = pipeline.finish()
    trajectory.parent.mkdir(parents=True, exist_ok=True)
    write_tum(trajectory, estimate.stamps_ns, estimate.final)
    return estimate.building


def _kept(path: Path) -> BuildingMap | None:
    try:
        building: BuildingMap = pickle.loads(path.read_bytes())
    except (OSError, EOFError, pickle.UnpicklingError, AttributeError, ImportError, TypeError):
        return None
    return building if all(hasattr(building, each.name) for each in fields(BuildingMap)) else None


def _keep(path: Path, building: BuildingMap) -> None:
    unfinished = path.with_suffix(f".{os.getpid()}.part")
    unfinished.write_bytes(pickle.dumps(building, protocol=pickle.HIGHEST_PROTOCOL))
    unfinished.rename(path)
