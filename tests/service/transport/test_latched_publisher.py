"""What a late subscriber gets."""

import numpy as np
from live.daemons import asked_for, into, message_of
from live.loopback import eventually, free_port
from live.runs import stamp_ns
from zenoh.ext import HistoryConfig, declare_advanced_subscriber

from wayfi.backend.grid.map_config import MapConfig
from wayfi.frontends.events import GridRedrawn
from wayfi.frontends.measurements import SECOND_NS
from wayfi.recordings.ros.messages import (
    OCCUPANCY_GRID,
)
from wayfi.service.config import ZenohConfig
from wayfi.service.transport.output_messages import map_message
from wayfi.service.transport.publishers import Publishers
from wayfi.service.transport.zenoh_session import open_guest_session, open_session


def test_a_late_subscriber_gets_the_newest_map() -> None:
    config = ZenohConfig(listen=[f"tcp/127.0.0.1:{free_port()}"])
    grids = [
        GridRedrawn(0, np.full((2, 2), 0.5, np.float32), 0.05, (0.0, 0.0)),
        GridRedrawn(7 * SECOND_NS, np.array([[0.1, 0.5, 0.9]], np.float32), 0.05, (-1.0, 2.0)),
    ]
    with open_session(config) as session, Publishers(session, config) as publishers:
        for grid in grids:
            publishers.publish_map(map_message(grid, MapConfig()))
        with open_guest_session(config) as late:
            eventually(lambda: map_message(grids[1], MapConfig()) in asked_for(late, "wayfi/map"))
            asked = asked_for(late, "wayfi/map")
            seen: list[bytes] = []
            history = HistoryConfig(max_samples=1, detect_late_publishers=True)
            with declare_advanced_subscriber(late, "wayfi/map", into(seen.append), history=history):
                eventually(lambda: seen)
    assert asked == seen == [map_message(grids[1], MapConfig())]
    message = message_of(asked[0], OCCUPANCY_GRID)
    assert message.data.tolist() == [0, -1, 100]
    assert (message.info.width, message.info.height, stamp_ns(message.header)) == (3, 1, 7 * SECOND_NS)
    assert (message.info.origin.position.x, message.info.origin.position.y) == (-1.0, 2.0)
