"""The worlds that can be simulated."""

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from wayfi.recordings.simulation.drive import RoutePlan, TrueMotion
from wayfi.recordings.simulation.laser import UST_20LX, LaserSpec
from wayfi.recordings.simulation.radio import RadioPlan
from wayfi.recordings.simulation.surfaces import Surfaces
from wayfi.recordings.simulation.worlds import campus, carpark, corridor, office, warehouse


class World(StrEnum):
    """The name of a world."""

    CARPARK = "carpark"
    OFFICE = "office"
    WAREHOUSE = "warehouse"
    CAMPUS = "campus"
    CORRIDOR = "corridor"
    RING = "ring"


@dataclass(frozen=True, slots=True)
class Blueprint:
    """A world: the route, the surfaces, the laser and the access points.

    People walk up to `aisle_m` to each side of the robot's path. Every second seed drives `other_route`, if there is
    one.
    """

    route: RoutePlan
    radio: RadioPlan
    surfaces: Callable[[TrueMotion, np.random.Generator], Surfaces]
    aisle_m: float
    laser: LaserSpec = UST_20LX
    other_route: RoutePlan | None = None


BLUEPRINTS = {
    World.CARPARK: Blueprint(
        carpark.ROUTE, carpark.RADIO, carpark.surfaces, aisle_m=1.6, other_route=carpark.ROUTE_AROUND
    ),
    World.OFFICE: Blueprint(office.ROUTE, office.RADIO, office.surfaces, aisle_m=0.65),
    World.WAREHOUSE: Blueprint(warehouse.ROUTE, warehouse.RADIO, warehouse.surfaces, aisle_m=0.6),
    World.CAMPUS: Blueprint(campus.ROUTE, campus.RADIO, campus.surfaces, aisle_m=0.65, laser=campus.LASER),
    World.CORRIDOR: Blueprint(
        corridor.STRAIGHT_ROUTE, corridor.STRAIGHT_RADIO, corridor.straight_surfaces, aisle_m=0.65, laser=corridor.LASER
    ),
    World.RING: Blueprint(
        corridor.RING_ROUTE, corridor.RING_RADIO, corridor.ring_surfaces, aisle_m=0.65, laser=corridor.LASER
    ),
}
