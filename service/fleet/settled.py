"""Runs that have ended are joined once and for all: the work of a round grows with the robots, not with the time.

The settled map is pruned as one that a robot drives again, so that it grows with the area. What of a run has gone into
it cannot be taken out again; therefore a run that may grow is joined to a copy, anew each time.
"""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.maps.aligning import moved
from wayfi.frontends.maps.building_map import BuildingMap
from wayfi.frontends.merging.common_map import common_map
from wayfi.recordings.files.atomic_files import write_text
from wayfi.recordings.files.map_folder import KEYFRAMES, MANIFEST, MapError, delete_map, locked
from wayfi.recordings.files.replaced_together import current
from wayfi.recordings.map.loading import load_map
from wayfi.recordings.map.saving import name_of_map, save_map
from wayfi.service.config import Config
from wayfi.service.fleet.fleet_file import FLEET, Fleet, Member, read_fleet
from wayfi.service.fleet.parts import Part
from wayfi.service.fleet.robot_folders import SETTLED, mirrored


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
    """What is settled so far. Raises MapError or FleetFileError where it is damaged."""
    folder = directory / SETTLED
    name, fleet = name_of_map(folder), read_fleet(folder)
    version = name.map_version if name else 0
    members = tuple(member for member in fleet.members if member.settled_in <= version)
    return Settled(load_map(folder).building if name else None, members)


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
    if now.building is not None and now is not settled:
        (directory / SETTLED).mkdir(exist_ok=True)
        write_text(directory / SETTLED / FLEET, Fleet(now.members).to_json())  # counts from that version on
        save_map(directory / SETTLED, now.building, config.map, name_of_map(directory / SETTLED))
    return now, left


def forget_copies(directory: Path, settled: Settled) -> None:
    """Keep of the copies of what is settled the manifest alone: what is not changed there is not fetched again."""
    for robot, run, folder in mirrored(directory):
        if current(folder, KEYFRAMES).exists() and settled.holds(robot, run, folder):
            with suppress(MapError, OSError), locked(folder):  # it is fetched just now: the next round sees to it
                if settled.holds(robot, run, folder):
                    delete_map(folder, [MANIFEST])


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
