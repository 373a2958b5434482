"""What tests share: the real recordings, where they are, and simulated ones, made once."""

import os
import sys
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from wayfi.recordings.simulation.recorder import SimulatedRecording, simulate
from wayfi.recordings.simulation.worlds.blueprints import World

os.environ["RERUN_ANALYTICS"] = "0"
sys.path.insert(0, str(Path(__file__).parent))  # import benchmarks.soak
sys.path.insert(0, str(Path(__file__).parent / "helpers"))
from drives import Replayed, Simulated, replay_by_cli, simulated
from live.loopback import Authority, secret
from places import REAL_DATA

if TYPE_CHECKING:
    from xdist.remote import Producer
    from xdist.scheduler import LoadFileScheduling

LIVE = tuple(f"tests/{part}" for part in ("service/daemon/", "service/fleet/", "service/transport/", "service/replay/"))
LONG = ("tests/system/", "tests/laws/")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with what takes longest, so that no worker waits for it at the end."""
    items.sort(key=lambda item: (not item.nodeid.startswith(LIVE), not item.nodeid.startswith(LONG)))


@cache
def is_live(file: Path) -> bool:
    """Whether tests of a file have sessions or processes of their own."""
    return any(helper in file.read_text() for helper in ("live.daemons", "live.loopback", "benchmarks.soak"))


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: "Producer") -> "LoadFileScheduling":
    """Each file is the work of one worker; sessions, daemons and their clocks are all one work, so that none meet."""
    from xdist.scheduler import LoadFileScheduling

    class Scheduling(LoadFileScheduling):
        def _split_scope(self, nodeid: str) -> str:
            file = super()._split_scope(nodeid)
            return "live" if file.startswith(LIVE) and is_live(config.rootpath / file) else file

    config.option.loadscopereorder = False  # or it begins with the file of most tests
    return Scheduling(config, log)


@pytest.fixture(scope="session")
def real_data() -> Path:
    """The folder of the real recordings."""
    if not REAL_DATA.is_dir():
        pytest.skip(f"the real recordings are not here: there is no folder {REAL_DATA}")
    return REAL_DATA


@pytest.fixture(scope="session")
def minute() -> Simulated:
    """One minute in the car park."""
    return simulated(World.CARPARK, 1.0)


@pytest.fixture(scope="session")
def half_minute() -> Simulated:
    """A little more than half a minute in the car park, for what needs many drives."""
    return simulated(World.CARPARK, 0.6, seed=3)


@pytest.fixture(scope="session")
def longer() -> Simulated:
    """A minute and a half in the car park."""
    return simulated(World.CARPARK, 1.5, seed=4)


@pytest.fixture(scope="session")
def carpark(tmp_path_factory: pytest.TempPathFactory) -> SimulatedRecording:
    """Six minutes in the car park, some of it twice."""
    return simulate(World.CARPARK, tmp_path_factory.mktemp("carpark"), minutes=6.0)


@pytest.fixture(scope="session")
def carpark_replay(carpark: SimulatedRecording, tmp_path_factory: pytest.TempPathFactory) -> Replayed:
    """The replay of `carpark`, by the command line; not to be changed."""
    out = tmp_path_factory.mktemp("carpark_replay") / "out"
    return Replayed(carpark, out, replay_by_cli(carpark.recording, out))


@pytest.fixture
def users(tmp_path: Path) -> Path:
    """The users file of a listener: alice and bob."""
    return secret(tmp_path / "users", "alice:open sesame\nbob:b\n")


@pytest.fixture
def authority(tmp_path: Path) -> Authority:
    """A certificate authority."""
    return Authority(tmp_path / "authority")
