"""The map of a robot's run as a part of the common one."""

from dataclasses import dataclass, replace

from wayfi.backend.pose2 import Pose2
from wayfi.frontends.maps.building_map import BuildingMap
from wayfi.frontends.merging.common_map import CommonMap
from wayfi.recordings.map.loading import LoadedMap
from wayfi.service.fleet.fleet_file import Member


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

    def member_of(self, common: CommonMap) -> Member:
        """How this map lies in the common one, or why it does not."""
        sessions = common.sessions.get(self.name, range(0))
        member = self.member(common.places.get(self.name), common.left_out.get(self.name, ""))
        return replace(member, sessions=(sessions.start, sessions.stop))

    def member(self, T_common_part: Pose2 | None, why: str = "", settled_in: int = 0) -> Member:
        """This map among the fleet's, whose frame lies where `T_common_part` puts what is joined of it."""
        T = T_common_part @ self.T_map_part.inverse() if T_common_part else None
        place = (float(T.x), float(T.y), float(T.theta)) if T else None
        return Member(self.robot, self.run, self.loaded.map_id, self.loaded.map_version, place, why, settled_in)
