"""The worlds that can be simulated."""

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from wayfi.recordings.simulation import carpark, office, warehouse
from wayfi.recordings.simulation.drive import Drive, RoutePlan
from wayfi.recordings.simulation.radio import RadioPlan
from wayfi.recordings.simulation.surfaces import Surfaces


class World(StrEnum):
    """A world by name."""

    CARPARK = "carpark"
    OFFICE = "office"
    WAREHOUSE = "warehouse"


@dataclass(frozen=True, slots=True)
class Blueprint:
    """What makes a world: where the robot drives, what its laser sees, what its phones hear."""

    route: RoutePlan
    radio: RadioPlan
    surfaces: Callable[[Drive, np.random.Generator], Surfaces]


BLUEPRINTS = {
    World.CARPARK: Blueprint(carpark.ROUTE, carpark.RADIO, carpark.surfaces),
    World.OFFICE: Blueprint(office.ROUTE, office.RADIO, office.surfaces),
    World.WAREHOUSE: Blueprint(warehouse.ROUTE, warehouse.RADIO, warehouse.surfaces),
}
