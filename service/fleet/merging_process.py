"""The process that joins the maps of a fleet: heavy, and ended by the daemon's end without a trace.

`python -m wayfi.service.fleet.merging_process DIRECTORY` joins what is in DIRECTORY/robots/ROBOT/RUN into
DIRECTORY/map, with the settings in DIRECTORY/config.toml.
"""

import os
import sys
from collections.abc import Collection, Sequence
from dataclasses import replace
from pathlib import Path
from uuid import uuid4

from wayfi.backend.errors import WayfiError
from wayfi.backend.pose2 import Pose2
from wayfi.frontends.maps.aligning import moved
from wayfi.frontends.maps.selecting import alone
from wayfi.frontends.merging.common_map import common_map
from wayfi.recordings.files.atomic_files import write_text
from wayfi.recordings.files.map_folder import MapError
from wayfi.recordings.map.loading import LoadedMap
from wayfi.recordings.map.manifest import MapName
from wayfi.recordings.map.saving import name_of_map, save_map
from wayfi.service.config import Config, load_config
from wayfi.service.fleet.consistent_maps import load_consistent
from wayfi.service.fleet.fleet_file import FLEET, Fleet, FleetFileError, read_fleet
from wayfi.service.fleet.parts import Part
from wayfi.service.fleet.robot_folders import CONFIG, MAP, SET_ASIDE, SETTLED, mirrored
from wayfi.service.fleet.settled import Settled, forget_copies, read_settled, settle, settled_anew

NICENESS = 5  # what the robots ask comes first
TRIED_AGAIN = 2  # runs of a robot before its newest that could not be joined so far: another robot may tie them in yet

Copy = tuple[str, str, Path]  # robot, run, folder


def join_maps(directory: Path, config: Config) -> Fleet:
    """Join the maps of the robots below `directory`, and save the common map there; returns what it is made of.

    The runs that have ended are settled, and never joined again. The common map has an id of its own, though it begins
    as that of one robot. Raises MapError where a map cannot be saved.
    """
    former = _former(directory / MAP)
    settled = _settled(directory, former, config)
    parts = _parts(directory, former, settled, config)
    settled, parts = settle(directory, settled, parts, former, config)
    forget_copies(directory, settled)
    if settled.building is None and parts:
        parts = [_where_it_lay(parts[0], former, config), *parts[1:]]
    maps = {part.name: part.building for part in parts}
    if settled.building is not None:
        maps = {SETTLED: settled.building} | maps
    if not maps:
        return Fleet()
    common = common_map(maps, config)
    fleet = Fleet((*settled.members, *(part.member_of(common) for part in parts)))
    save_map(directory / MAP, common.building, config.map, name_of_map(directory / MAP) or MapName(uuid4().hex, 0))
    write_text(directory / MAP / FLEET, fleet.to_json())
    return fleet


def _parts(directory: Path, former: Fleet, settled: Settled, config: Config) -> list[Part]:
    """The maps that are not settled: those that the common one is made of first, in their order, then by their age."""
    joined = [f"{member.robot}/{member.run}" for member in former.members if member.T_common_map]
    order = {name: number for number, name in enumerate(joined)}
    live = [each for each in mirrored(directory) if not settled.holds(*each)]
    loaded = [(robot, run, _loaded(folder)) for robot, run, folder in _tried(live, joined)]
    parts = [Part(robot, run, one, one.building) for robot, run, one in loaded if one and one.building.keyframes]
    parts.sort(key=lambda p: (order.get(p.name, len(order)), p.building.keyframes[0].stamp_ns, p.name))
    common = name_of_map(directory / MAP)
    seen = {member.map_id for member in settled.members if member.T_common_map} | ({common.map_id} if common else set())
    own = []
    for part in parts:
        own.append(_own(part, config) if part.loaded.map_id in seen else part)
        seen.add(part.loaded.map_id)
    return own


def _tried(live: Sequence[Copy], joined: Collection[str]) -> list[Copy]:
    """The copies of maps that were joined before, and of each robot's others the newest few."""
    newer = {(robot, run): sum(other == robot and later > run for other, later, _ in live) for robot, run, _ in live}
    return [each for each in live if f"{each[0]}/{each[1]}" in joined or newer[each[:2]] <= TRIED_AGAIN]


def _former(folder: Path) -> Fleet:
    """What the common map was made of so far; nothing, with a line, where that file is damaged."""
    try:
        return read_fleet(folder)
    except FleetFileError as error:
        _tell(error)
        return Fleet()


def _settled(directory: Path, former: Fleet, config: Config) -> Settled:
    """What is settled; where that is damaged, what takes its place, with a line."""
    try:
        return read_settled(directory)
    except (MapError, FleetFileError) as error:
        settled = settled_anew(directory, former, config)
        made = "the common map" if settled.members else "what robots still serve"
        _tell(f"{error}; {directory / SETTLED} is made anew of {made}, and what was there is in {SET_ASIDE}")
        return settled


def _own(part: Part, config: Config) -> Part:
    """Of a map that another robot goes on with as well, what this one has added: its newest session."""
    keyframes = part.building.keyframes
    newest = max(keyframe.session for keyframe in keyframes)
    first = next(k for k, keyframe in enumerate(keyframes) if keyframe.session == newest)
    return replace(
        part, building=alone(part.building, first, config.map), T_map_part=Pose2.of(part.building.poses[first])
    )


def _where_it_lay(part: Part, former: Fleet, config: Config) -> Part:
    """The first part in the frame of the former common map, which stays though what it began with is gone."""
    place = former.place_of(part.robot, part.run)
    T = Pose2(*place) @ part.T_map_part if place else Pose2()
    if Pose2() == T:
        return part
    building = moved(part.building, T, config.map)
    return replace(part, building=building, T_map_part=part.T_map_part @ T.inverse())


def _loaded(folder: Path) -> LoadedMap | None:
    """The map in a folder; None, with a line, where it is damaged or contradicts itself."""
    try:
        return load_consistent(folder)
    except MapError as error:
        _tell(error)
        return None


def _tell(error: WayfiError | str) -> None:
    sys.stderr.write(f"wayfi: {error}\n")


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
