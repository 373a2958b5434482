"""One case measured: replayed in a process of its own, and scored by the references that it has."""

import json
import resource
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from cases import Case, make
from crispness import WHEELS_ALONE, hits, wall_area_m2
from PIL import Image

from wayfi.frontends.measurements import Odometry, Sensor
from wayfi.recordings.files.tables import ClosureRow, read_closures
from wayfi.recordings.files.tum import read_tum
from wayfi.recordings.mcap.recording import open_recording
from wayfi.recordings.ros.codec import decode
from wayfi.recordings.ros.messages import DEFAULT_TOPICS
from wayfi.recordings.ros.topics import Encoding
from wayfi.recordings.trajectory import Trajectory
from wayfi.service.evaluation.evaluate import ON_SCAN_S, Evaluation, evaluate, read_relations
from wayfi.service.evaluation.trajectory_scores import RelationError, absolute_error, relation_error

PICTURES = Path(__file__).with_name("maps")
PICTURE_PX, PICTURE_COLOURS = 1100, 16


@dataclass(frozen=True, slots=True)
class Measured:
    """What came out of a case: the replay's report and closures, its CPU seconds, and the size of its log.

    `evaluation` and `wheels_ate_m` need a reference, `relations` (over all, and where both ends are on scans) a file of
    them. `wall_areas_m2` are as estimated and by the wheels alone, where the walls are the only measure.
    """

    case: Case
    report: dict[str, Any]
    rows: list[ClosureRow]
    cpu_s: float
    rrd_mb: float
    evaluation: Evaluation | None = None
    wheels_ate_m: float | None = None
    relations: tuple[RelationError, RelationError] | None = None
    wall_areas_m2: tuple[float, float] | None = None

    @property
    def wall_s(self) -> float:
        """Seconds of the replay, its files included."""
        return float(self.report["wall_s"] + self.report["stages"]["files"]["seconds"])


def measure(case: Case, keep_picture: bool = False) -> Measured:
    """Replay a case and score it; keep a small picture of its map if that is asked for and the case is `pictured`."""
    make(case)
    with tempfile.TemporaryDirectory() as made:
        options, out = list(case.options), Path(made) / "out"
        if case.taught:
            replay(case.taught, Path(made) / "before")
            options += ["--calibration", str(Path(made) / "before" / "calibration.toml")]
        before_s = children_cpu_s()
        report = replay(case.folder, out, *options)
        cpu_s = children_cpu_s() - before_s
        if keep_picture and case.pictured:
            write_picture(out / "map.png", PICTURES / f"{case.name}.png")
        return scored(case, out, report, cpu_s)


def scored(case: Case, out: Path, report: dict[str, Any], cpu_s: float) -> Measured:
    """The scores of a replay in `out`."""
    truth, relations = case.folder / "truth.tum", case.folder / "relations.txt"
    return Measured(
        case=case,
        report=report,
        rows=read_closures(out / "closures.csv"),
        cpu_s=cpu_s,
        rrd_mb=(out / "session.rrd").stat().st_size / 1e6,
        evaluation=evaluate(out, truth) if truth.exists() else None,
        wheels_ate_m=wheels_ate_m(case.recording, truth) if truth.exists() else None,
        relations=relation_errors(out, relations) if relations.exists() else None,
        wall_areas_m2=wall_areas_m2(case) if case.pictured else None,
    )


def relation_errors(out: Path, relations: Path) -> tuple[RelationError, RelationError]:
    """The errors against hand-checked relations, over all and where both ends are on scans."""
    estimate, checked = read_tum(out / "trajectory.tum"), read_relations(relations)
    return relation_error(estimate, checked), relation_error(estimate, checked, ON_SCAN_S)


def wheels_ate_m(recording: Path, truth: Path) -> float | None:
    """The ATE RMSE (m) of the recorded odometry as it is; None without odometry."""
    decoded = (
        decode(record.data, Sensor.ODOM, Encoding(record.encoding))
        for record in open_recording(recording)
        if record.topic == DEFAULT_TOPICS[Sensor.ODOM]
    )
    poses = {m.stamp_ns: m.pose.array() for m in decoded if isinstance(m, Odometry) and m.pose.is_finite()}
    if len(poses) < 2:
        return None
    stamps_ns = np.array(sorted(poses), np.int64)
    wheels = Trajectory(stamps_ns, np.array([poses[stamp_ns] for stamp_ns in stamps_ns.tolist()]))
    return absolute_error(wheels, read_tum(truth)).error.ate_rmse_m


def wall_areas_m2(case: Case) -> tuple[float, float]:
    """The area that the laser's hits fill, as estimated and by the wheels alone; see `crispness`."""
    estimated, by_wheels = (
        wall_area_m2(hits(case.recording, [*case.settings, *settings])) for settings in ((), WHEELS_ALONE)
    )
    return estimated, by_wheels


def replay(folder: Path, out: Path, *options: str) -> dict[str, Any]:
    """Replay a folder's recording into `out`; the report."""
    command = [sys.executable, "-m", "wayfi.service.cli", "replay", str(folder / "recording.mcap"), "--out", str(out)]
    done = subprocess.run([*command, "--json", *options], capture_output=True, text=True, check=False)
    if done.returncode:
        sys.exit(f"{folder}: {done.stderr.strip()}")
    report: dict[str, Any] = json.loads(done.stdout)
    return report


def children_cpu_s() -> float:
    """CPU seconds of the processes that have ended under this one, theirs included."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def write_picture(source: Path, target: Path) -> None:
    """A copy of a map's picture that is small enough to keep: PICTURE_PX on its longer side, few colours."""
    target.parent.mkdir(exist_ok=True)
    with Image.open(source) as picture:
        picture.thumbnail((PICTURE_PX, PICTURE_PX), Image.Resampling.BOX)
        picture.quantize(PICTURE_COLOURS).save(target, optimize=True)
