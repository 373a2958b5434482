"""Commands that edit the graph of a running daemon: each is answered, whatever it asks for."""

import json
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import zenoh
from live.daemons import Running, asked_for, odometry, running
from live.loopback import eventually
from live.runs import replays_alike

from wayfi.frontends.measurements import Odometry, PoseFix, Sensor
from wayfi.recordings.ros.codec import decode, encode
from wayfi.recordings.ros.topics import Encoding

SURE = np.diag([0.3**2, 0.3**2, 0.2**2])


@pytest.fixture(scope="module")
def daemon(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Running]:
    with running(tmp_path_factory.mktemp("runs")) as daemon:
        yield daemon
        assert daemon.stop() == 0, daemon.stderr


def told(daemon: Running, command: str, argument: str) -> tuple[bool, str]:
    """The answer to a command."""
    (answer,) = asked_for(daemon.session, daemon.key(f"wayfi/command/{command}") + argument)
    return json.loads(answer)["ok"], json.loads(answer)["message"]


@pytest.mark.parametrize("command", ["veto", "restore"])
@pytest.mark.parametrize("argument", ["?3", "?closure=3", "?abc", "", "?-1", "?1e3", "?99999999999999"])
def test_what_cannot_be_done_is_answered(daemon: Running, command: str, argument: str) -> None:
    ok, message = told(daemon, command, argument)
    assert not ok
    by_number = argument in ("?3", "?closure=3")
    there_is_none = "there is no closure 3" if command == "veto" else "closure 3 is not vetoed"
    assert (there_is_none if by_number else f"{command} needs the number of a closure") in message


def test_a_fix_is_vetoed_and_restored_and_the_run_replays_alike(tmp_path: Path) -> None:
    with running(tmp_path / "runs") as daemon:
        put = partial(daemon.session.put, congestion_control=zenoh.CongestionControl.BLOCK)
        for number in range(200):
            data = odometry(number)
            put(daemon.key("odom"), data)
            m = decode(data, Sensor.ODOM, Encoding.CDR)
            assert isinstance(m, Odometry)
            if number == 150:
                put(daemon.key("fix"), encode(PoseFix(m.stamp_ns, m.pose, SURE)))
        eventually(lambda: told(daemon, "veto", "?0") == (True, "closure 0 is vetoed, and the map optimised anew"))
        assert told(daemon, "veto", "?0") == (False, "closure 0 is vetoed already")
        assert told(daemon, "restore", "?0") == (True, "closure 0 is restored, and the map optimised anew")
        assert daemon.stop() == 0, daemon.stderr
    assert ",fix,outside," in (daemon.folder / "closures.csv").read_text()
    assert replays_alike(daemon.folder, tmp_path / "replayed")
