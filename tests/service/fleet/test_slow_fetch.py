"""A merging daemon that is stopped while a robot answers slowly, or not at all, ends in time and keeps what it has."""

import signal
import time
from contextlib import ExitStack
from pathlib import Path

import zenoh
from building_maps.rounds import round_map
from live.daemons import Running, running
from live.loopback import endpoint, eventually

from wayfi.recordings.files.map_folder import MANIFEST
from wayfi.recordings.map.manifest import read_manifest
from wayfi.recordings.map.saving import STAGED, name_of_map, save_map
from wayfi.service.config import ZenohConfig
from wayfi.service.fleet.robot_folders import robot_folder
from wayfi.service.transport.zenoh_session import open_session

KEY = "robot1/wayfi/keyframes/run"
STOPPED_S = 10.0  # what a service manager is promised


class SlowRobot:
    """Serves the map in a folder: its manifest and one more file at once, then nothing until it is `awake`."""

    def __init__(self, folder: Path) -> None:
        self._folder, self.awake = folder, False
        self.asked: list[str] = []
        self._held: list[zenoh.Query] = []

    def answer(self, query: zenoh.Query) -> None:
        file = str(query.key_expr).rpartition("/")[2]
        if file != MANIFEST:
            self.asked.append(file)
            if len(self.asked) > 1 and not self.awake:
                self._held.append(query)
                return
        with query:
            query.reply(f"{KEY}/{file}", (self._folder / file).read_bytes())


def test_a_stop_during_a_slow_fetch_is_obeyed_and_the_rest_is_fetched_the_next_time(tmp_path: Path) -> None:
    served, where, often = tmp_path / "map", endpoint(), "zenoh.fleet_every_s=0.3"
    save_map(served, round_map())
    robot, fetched = SlowRobot(served), robot_folder(tmp_path / "fleet", "robot1", "run")
    with ExitStack() as opened:
        session = opened.enter_context(open_session(ZenohConfig(listen=[where])))
        opened.enter_context(session.declare_queryable("robot1/wayfi/keyframes/*/*", robot.answer))
        settings = (often, f'zenoh.connect=["{where}"]')
        merging: Running = opened.enter_context(
            running(tmp_path / "fleet", *settings, flags=("--merge",), prefix="office")
        )
        eventually(lambda: len(robot.asked) > 1)
        begun_s = time.monotonic()
        assert merging.stop(signal.SIGTERM) == 0
        assert time.monotonic() - begun_s < STOPPED_S
        assert "Traceback" not in merging.stderr
        assert len(merging.lines('"stopped"')) == 1
        assert name_of_map(fetched) is None
        assert (fetched / STAGED / robot.asked[0]).exists()
        robot.awake = True
        merging.start_again()
        eventually(lambda: name_of_map(fetched) == name_of_map(served))
    assert robot.asked.count(robot.asked[0]) == 1
    assert set(robot.asked) == set(read_manifest(served).files)
