"""Runs that have ended are joined once and for all: the work of a round grows with the robots, not with the time.

The settled map is pruned as one that a robot drives again, so that it grows with the area. What of a run has gone into
it cannot be taken out again; therefore a run that may grow is joined to a copy, anew each time. Where the settled map
is damaged, the common map, which holds all of it, takes its place, without the runs that are joined to it again.
"""

import shutil
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.maps.aligning import moved
from wayfi.frontends.maps.building_map import BuildingMap
from wayfi.frontends.maps.pruning import without_sessions
from wayfi.frontends.merging.common_map import common_map
from wayfi.recordings.files.atomic_files import write_text
from wayfi.recordings.files.map_folder import KEYFRAMES, MANIFEST, MapError, delete_map, files_of_a_map, locked
from wayfi.recordings.files.replaced_together import current
from wayfi.recordings.map.saving import name_of_map, save_map
from wayfi.service.config import Config
from wayfi.service.fleet.consistent_maps import load_consistent
from wayfi.service.fleet.fleet_file import FLEET, Fleet, FleetFileError, Member, read_fleet
from wayfi.service.fleet.parts import Part
from wayfi.service.fleet.robot_folders import MAP, SET_ASIDE, SETTLED, mirrored, robot_folder


@dataclass(frozen=True, slots=True, eq=False)
class Settled:
    """The map of all runs that are settled, in the frame of the common one, None without any; and which they are."""

    building: BuildingMap | None
    members: tuple[Member, ...]

    def holds(self, robot: str, run: str, folder: Path) -> bool:
        """Whether the copy in `folder` of the map of a run, in its present version, is settled."""
        known = next((m for m in self.members if (m.robot, m.run) == (robot, run)), None)
        name = name_of_map(folder)
        return (
            known is not None
            and name is not None
            and ((known.map_id, known.map_version) == (name.map_id, name.map_version))
        )


def read_settled(directory: Path) -> Settled:
    """What is settled so far. Raises MapError or FleetFileError where any of it is damaged."""
    folder = directory / SETTLED
    if not files_of_a_map(folder):
        return Settled(None, ())
    loaded = load_consistent(folder)
    if loaded.warnings:
        raise MapError(loaded.warnings[0])
    members = tuple(member for member in read_fleet(folder).members if member.settled_in <= loaded.map_version)
    if not members:
        raise FleetFileError(f"{folder / FLEET}: does not say which runs are settled")
    return Settled(loaded.building, members)


def settled_anew(directory: Path, former: Fleet, config: Config) -> Settled:
    """Set a damaged settled map aside, in place of one that was set aside before; returns what takes its place.

    That is the common map, whose members are `former`, without those runs of which there is a copy; nothing where it
    is damaged as well. Raises MapError or OSError where that cannot be written.
    """
    folder, aside = directory / SETTLED, directory / SET_ASIDE
    shutil.rmtree(aside, ignore_errors=True)
    folder.rename(aside)
    again = [member for member in former.members if _is_joined_again(directory, member)]
    members = tuple(
        replace(m, settled_in=1, sessions=(0, 0)) for m in former.members if m.T_common_map and m not in again
    )
    left_out = {session for member in again for session in range(*member.sessions)}
    try:
        common = load_consistent(directory / MAP).building if members else None
    except MapError:
        common = None
    if common is None:
        return Settled(None, ())
    settled = Settled(without_sessions(common, left_out, config.map), members)
    _save(directory, settled, config)
    return settled


def _is_joined_again(directory: Path, member: Member) -> bool:
    """Whether it is known what of the common map is of a run, and there is a whole copy of the run's own map."""
    first, end = member.sessions
    known = not member.settled_in and first < end
    return known and current(robot_folder(directory, member.robot, member.run), KEYFRAMES).exists()


def settle(
    directory: Path, settled: Settled, parts: Sequence[Part], former: Fleet, config: Config
) -> tuple[Settled, list[Part]]:
    """Settle the runs that have ended, as far as they join; returns what is settled then, and the other parts.

    One has ended where the round before knew a newer run of the robot: the end of it has been fetched since. Raises
    MapError where that cannot be saved.
    """
    now, left, version = settled, list[Part](), _version(directory) + 1
    for part in parts:
        found = _joined(now, part, former, version, config) if _has_ended(part, former) else None
        now, left = (found, left) if found else (now, [*left, part])
    if now is not settled:
        _save(directory, now, config)
    return now, left


def forget_copies(directory: Path, settled: Settled) -> None:
    """Keep of the copies of what is settled the manifest alone: what is not changed there is not fetched again.

    Where the manifest alone is left of what is not settled any more, that goes as well: the map is fetched again.
    """
    for robot, run, folder in mirrored(directory):
        if current(folder, KEYFRAMES).exists() == settled.holds(robot, run, folder):
            with suppress(MapError, OSError), locked(folder):  # it is fetched just now: the next round sees to it
                held = settled.holds(robot, run, folder)
                if current(folder, KEYFRAMES).exists() == held:
                    delete_map(folder, [MANIFEST] if held else [])


def _save(directory: Path, settled: Settled, config: Config) -> None:
    folder = directory / SETTLED
    folder.mkdir(exist_ok=True)
    write_text(folder / FLEET, Fleet(settled.members).to_json())  # counts from that version on
    if settled.building is not None:
        save_map(folder, settled.building, config.map, name_of_map(folder))


def _version(directory: Path) -> int:
    name = name_of_map(directory / SETTLED)
    return name.map_version if name else 0


def _has_ended(part: Part, former: Fleet) -> bool:
    return any(member.robot == part.robot and member.run > part.run for member in former.members)


def _joined(settled: Settled, part: Part, former: Fleet, version: int, config: Config) -> Settled | None:
    """What is settled with a part more; None where it does not join. The first stays where it lay."""
    if settled.building is None:
        place = former.place_of(part.robot, part.run)
        if place is None:
            return None
        T = Pose2(*place) @ part.T_map_part
        building = moved(part.building, T, config.map)
    else:
        common = common_map({SETTLED: settled.building, part.name: part.building}, config)
        if part.name in common.left_out:
            return None
        building, T = common.building, common.places[part.name]
    others = (m for m in settled.members if (m.robot, m.run) != (part.robot, part.run))
    return Settled(building, (*others, part.member(T, settled_in=version)))
