"""The map that a drive goes on with, and the map that it makes."""

from collections.abc import Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass

import numpy as np

from wayfi.backend.graph.pose_graph import PoseGraph
from wayfi.backend.grid.floor_grids import FloorGrids
from wayfi.backend.grid.occupancy_grid import OccupancyGrid
from wayfi.backend.pose2 import Floats, compose_all, rigid_fit
from wayfi.frontends.calibration import Calibration
from wayfi.frontends.closures.lidar_closer import LidarCloser
from wayfi.frontends.closures.verdicts import Verdicts
from wayfi.frontends.closures.vetoes import Closer, FormerClosures, VetoedClosure, Vetoes
from wayfi.frontends.event_making import grid_event, keyframe_event
from wayfi.frontends.events import Event
from wayfi.frontends.keyframes import Keyframes
from wayfi.frontends.maps.building_map import BuildingMap, MapClosure, MapFingerprint, MapKeyframe
from wayfi.frontends.maps.continuing import keyframes_before, load_graph
from wayfi.frontends.odometry.driven_path import PathPoint
from wayfi.frontends.odometry.trajectories import Trajectories
from wayfi.frontends.result import DriveEstimate, floors_at
from wayfi.frontends.wifi.wifi_frontend import WifiFrontend


@dataclass(frozen=True, slots=True, eq=False)
class MapBefore:
    """The map that a drive goes on with, and its closures that no closer of the drive holds, by their factors."""

    building: BuildingMap
    closures: FormerClosures


@dataclass(frozen=True, slots=True, eq=False)
class DriveParts:
    """What a drive's map is made of, and can begin with."""

    graph: PoseGraph
    keyframes: Keyframes
    wifi: WifiFrontend
    grids: FloorGrids
    verdicts: Verdicts
    lidar_closer: LidarCloser
    closers: Sequence[Closer]
    vetoes: Vetoes


def begin_with(building: BuildingMap, parts: DriveParts, gap_m: float) -> MapBefore:
    """Fill the parts of a drive that has not begun with a map, whose path ends `gap_m` before the drive's."""
    numbers = load_graph(parts.graph, building)
    keyframes = keyframes_before(building, gap_m)
    parts.keyframes.begin_with(keyframes, [k.floor for k in building.keyframes], building.pieces)
    for k in building.keyframes:
        sensor = k.scan.T_base_laser if k.scan else None
        parts.grids.add(k.floor, k.hits, (sensor.x, sensor.y) if sensor else (0.0, 0.0))
    parts.grids.redraw(building.poses, parts.keyframes.floors)  # now, since no message may take so long
    for f in building.fingerprints:
        place = keyframes[f.keyframe].point
        point = PathPoint(f.stamp_ns, place.T_path_base @ f.T_keyframe_base, place.path_m)
        parts.wifi.add(f.receiver, f.keyframe, f.T_keyframe_base, point, f.readings)
    parts.verdicts.begin_with(closure.judged for closure in building.closures)
    factors = {
        number: tuple(numbers[n] for n in closure.factors)
        for number, closure in enumerate(building.closures)
        if closure.factors and number not in building.vetoed
    }
    parts.lidar_closer.begin_with(factors)
    held = parts.lidar_closer.factors()
    former = FormerClosures({n: own for n, own in factors.items() if n not in held}, len(building.closures))
    parts.vetoes.begin_with({number: _vetoed(building, number) for number in building.vetoed}, former)
    return MapBefore(building, former)


def _vetoed(building: BuildingMap, number: int) -> VetoedClosure:
    closure = building.closures[number]
    return VetoedClosure(closure.judged, tuple(building.factors[n] for n in closure.factors))


def in_frame_of(poses: Floats, before: MapBefore | None) -> Floats:
    """(n, 3) the poses of a drive's keyframes in the frame of the map that it went on with.

    The first keyframe holds the graph; as its heading in the map becomes better known, all the others turn around it.
    """
    if before is None or not before.building.keyframes:
        return poses.copy()
    earlier = before.building.poses
    T = rigid_fit(poses[: len(earlier), :2], earlier[:, :2])
    return compose_all(T.array(), poses)


def map_of(
    parts: DriveParts, poses: Floats, grids: Mapping[int, OccupancyGrid], before: MapBefore | None
) -> BuildingMap:
    """The map of a drive at the keyframes' `poses` (n, 3), and of what it has gone on with."""
    calibration = Calibration(parts.graph.calibration(), parts.wifi.receivers.offsets)
    first = parts.keyframes.first
    calibrations, factors = parts.graph.calibrations_along(), parts.graph.factors()
    of_closures = {number: own for closer in parts.closers for number, own in closer.factors().items()}
    session = 0
    if before is not None:
        session = 1 + max(k.session for k in before.building.keyframes)
        calibrations[:first] = before.building.calibrations
        of_closures |= before.closures.factors()
    judged = list(parts.verdicts)
    for number, vetoed in sorted(parts.vetoes.kept.items()):
        kept = dict(enumerate(vetoed.factors, max(factors, default=-1) + 1))
        factors, of_closures = factors | kept, of_closures | {number: tuple(kept)}
        judged[number] = vetoed.judged
    return BuildingMap(
        _map_keyframes(parts, session, before), poses, calibrations, factors,
        [MapClosure(each, of_closures.get(each.closure, ())) for each in judged],
        [
            MapFingerprint(f.stamp_ns, f.receiver, f.keyframe, f.T_keyframe_base, f.path_m, f.readings)
            for f in parts.wifi.fingerprints
        ],
        parts.wifi.weights(), calibration, grids, tuple(parts.keyframes.moved_to),
        frozenset(parts.vetoes.kept),
    )  # fmt: skip


def history_of(parts: DriveParts, poses: Floats, stamp_ns: int) -> list[Event]:
    """Every keyframe with its scan at its present pose of `poses` (n, 3), and the present floor's grid."""
    numbered = enumerate(zip(parts.keyframes, poses, strict=True))
    keyframes = [keyframe_event(number, k, pose, np.nan) for number, (k, pose) in numbered]
    return [
        *keyframes,
        grid_event(stamp_ns, deepcopy(parts.grids).redraw(poses, parts.keyframes.floors), parts.keyframes.floor),
    ]


def drive_estimate(trajectories: Trajectories, keyframes: Keyframes, building: BuildingMap) -> DriveEstimate:
    """The drive at its end, by the poses of all `keyframes` in the map that it has made."""
    first, points = keyframes.first, [k.point for k in keyframes.own]
    moved_to = [k - first for k in keyframes.moved_to if k > first]
    final = trajectories.final(points, building.poses[first:], building.calibration.wheels.values, moved_to)
    stamps_ns = trajectories.stamps_ns()
    since = [(point.stamp_ns, floor) for point, floor in zip(points, keyframes.floors[first:].tolist(), strict=True)]
    return DriveEstimate(stamps_ns, final, trajectories.online(), building, floors_at(stamps_ns, since))


def _map_keyframes(parts: DriveParts, session: int, before: MapBefore | None) -> list[MapKeyframe]:
    paths_m = parts.keyframes.paths_m - parts.keyframes.paths_m[0] if len(parts.keyframes) else np.empty(0)
    known = before.building.keyframes if before else []
    sessions = [k.session for k in known] + [session] * (len(parts.keyframes) - len(known))
    floors = parts.keyframes.floors.tolist()
    return [
        MapKeyframe(k.point.stamp_ns, float(path_m), k.scan, *rest)
        for k, path_m, *rest in zip(parts.keyframes, paths_m, parts.grids.hits(), sessions, floors, strict=True)
    ]
