"""The process that joins the maps of a fleet: heavy, and ended by the daemon's end without a trace.

`python -m wayfi.service.fleet.merging_process DIRECTORY` joins what is in DIRECTORY/robots/ROBOT/RUN into
DIRECTORY/map, with the settings in DIRECTORY/config.toml.
"""

import os
import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from wayfi.backend.errors import WayfiError
from wayfi.backend.pose2 import Pose2
from wayfi.frontends.maps.building_map import BuildingMap
from wayfi.frontends.maps.selecting import alone
from wayfi.frontends.merging.common_map import common_map
from wayfi.recordings.files.atomic_files import write_text
from wayfi.recordings.files.map_folder import MapError
from wayfi.recordings.map.loading import LoadedMap, load_map
from wayfi.recordings.map.saving import name_of_map, save_map
from wayfi.service.config import Config, load_config
from wayfi.service.fleet.fleet_file import FLEET, Fleet, FleetFileError, Member, read_fleet
from wayfi.service.fleet.robot_folders import CONFIG, MAP, mirrored

NICENESS = 5  # what the robots ask comes first


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """A robot's map as it is joined; `T_map_part` is where the frame of what is joined lies in that of the map."""

    robot: str
    run: str
    loaded: LoadedMap
    building: BuildingMap
    T_map_part: Pose2 = Pose2()

    @property
    def name(self) -> str:
        """Of this map among the fleet's."""
        return f"{self.robot}/{self.run}"

    def member(self, T_common_part: Pose2 | None, why: str = "") -> Member:
        """How this map lies in the common one, or why it does not."""
        place = tuple(map(float, (T_common_part @ self.T_map_part.inverse()).array())) if T_common_part else None
        return Member(self.robot, self.run, self.loaded.map_id, self.loaded.map_version, place, why)  # type: ignore[arg-type]


def join_maps(directory: Path, config: Config) -> Fleet:
    """Join the maps of the robots below `directory`, and save the common map there; returns what it is made of.

    Raises MapError where it cannot be saved.
    """
    parts = _parts(directory, config)
    if not parts:
        return Fleet()
    common = common_map({part.name: part.building for part in parts}, config)
    members = [part.member(common.places.get(part.name), common.left_out.get(part.name, "")) for part in parts]
    fleet = Fleet(tuple(members))
    save_map(directory / MAP, common.building, config.map, name_of_map(directory / MAP))
    write_text(directory / MAP / FLEET, fleet.to_json())
    return fleet


def _parts(directory: Path, config: Config) -> list[Part]:
    """The maps that can be joined: those that the common one is made of first, in their order, then by their age."""
    loaded = [(robot, run, _loaded(folder)) for robot, run, folder in mirrored(directory)]
    parts = [Part(robot, run, one, one.building) for robot, run, one in loaded if one and one.building.keyframes]
    former = [f"{member.robot}/{member.run}" for member in _former(directory).members if member.T_common_map]
    order = {name: number for number, name in enumerate(former)}
    parts.sort(key=lambda p: (order.get(p.name, len(order)), p.building.keyframes[0].stamp_ns, p.name))
    seen: set[str] = set()
    joined = []
    for part in parts:
        joined.append(_own(part, config) if part.loaded.map_id in seen else part)
        seen.add(part.loaded.map_id)
    return joined


def _former(directory: Path) -> Fleet:
    """What the common map was made of so far; nothing, with a line, where that file is damaged."""
    try:
        return read_fleet(directory / MAP)
    except FleetFileError as error:
        sys.stderr.write(f"wayfi: {error}\n")
        return Fleet()


def _own(part: Part, config: Config) -> Part:
    """Of a map that another robot goes on with as well, what this one has added: its newest session."""
    keyframes = part.building.keyframes
    newest = max(keyframe.session for keyframe in keyframes)
    first = next(k for k, keyframe in enumerate(keyframes) if keyframe.session == newest)
    return replace(
        part, building=alone(part.building, first, config.map), T_map_part=Pose2.of(part.building.poses[first])
    )


def _loaded(folder: Path) -> LoadedMap | None:
    """The map in a folder; None, with a line, where it is damaged or contradicts itself."""
    try:
        loaded = load_map(folder)
        if not _consistent(loaded.building):
            raise MapError(f"{folder}: contradicts itself: it relates keyframes that it does not have; delete it there")
    except MapError as error:
        sys.stderr.write(f"wayfi: {error}\n")
        return None
    return loaded


def _consistent(building: BuildingMap) -> bool:
    """Whether all poses are finite, and all that is related to keyframes is to keyframes of the map."""
    related = [f.keyframe for f in building.fingerprints]
    related += [k for factor in building.factors.values() for k in (factor.a, factor.b)]
    return bool(np.isfinite(building.poses).all()) and max(related, default=0) < len(building.keyframes)


def main() -> None:
    """Join the maps below the directory that is the only argument; exit 1 with one line where that fails."""
    os.nice(NICENESS)
    directory = Path(sys.argv[1])
    try:
        join_maps(directory, load_config([directory / CONFIG]))
    except (WayfiError, OSError) as error:
        sys.exit(f"wayfi: {error}")


if __name__ == "__main__":
    main()
