"""fleet.json: which maps the common map of a fleet is made of, and where each lies in it."""

import json
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from wayfi.backend.errors import WayfiError
from wayfi.recordings.files.replaced_together import read_current

FLEET = "fleet.json"  # in the folder of the common map


class FleetFileError(WayfiError):
    """A file that does not say how a common map is made."""


@dataclass(frozen=True, slots=True)
class Member:
    """A map of a robot's run; `T_common_map` is where its frame lies (x, y m, theta rad), None where `why` tells.

    `settled_in` is the version of the settled map that holds it once and for all, 0 while it is joined anew each time.
    Its `sessions` in the common map are those from the first number to before the second, where they are known.
    """

    robot: str
    run: str
    map_id: str
    map_version: int
    T_common_map: tuple[float, float, float] | None
    why: str = ""
    settled_in: int = 0
    sessions: tuple[int, int] = (0, 0)


@dataclass(frozen=True, slots=True)
class Fleet:
    """The members in the order in which they came; the frame of the common map is that of the first."""

    members: Sequence[Member] = ()

    def to_json(self) -> str:
        """The text of the file."""
        return json.dumps({"members": [asdict(member) for member in self.members]}, indent=1) + "\n"

    def place_of(self, robot: str, run: str) -> tuple[float, float, float] | None:
        """Where the frame of the map of a robot's run lies in the common one; None where that is not known."""
        return next((m.T_common_map for m in self.members if (m.robot, m.run) == (robot, run)), None)


def parse_fleet(data: bytes, where: str) -> Fleet:
    """The fleet that `to_json` made these bytes of. Raises FleetFileError, which names `where`."""
    try:
        return Fleet(tuple(_member(found) for found in json.loads(data)["members"]))
    except (ValueError, KeyError, TypeError, AttributeError, OverflowError, RecursionError) as error:
        raise FleetFileError(f"{where}: does not say how a common map is made: {error!r}") from None


def read_fleet(folder: Path) -> Fleet:
    """The fleet of the common map in `folder`; without members where there is none yet. Raises FleetFileError."""
    try:
        return parse_fleet(read_current(folder, FLEET), str(folder / FLEET))
    except OSError:
        return Fleet()


def _member(found: dict[str, object]) -> Member:
    place = found["T_common_map"]
    if place is not None:
        x, y, theta = map(float, place)  # type: ignore[call-overload]
        if not all(map(math.isfinite, (x, y, theta))):
            raise ValueError(f"a place that is not finite: {place}")
        place = (x, y, theta)
    first, end = map(int, found.get("sessions", (0, 0)))  # type: ignore[call-overload]
    return Member(
        str(found["robot"]), str(found["run"]), str(found["map_id"]), int(str(found["map_version"])), place,
        str(found["why"]), int(str(found.get("settled_in", 0))), (first, end),
    )  # fmt: skip
