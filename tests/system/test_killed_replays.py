"""A replay that fails or is killed leaves what it has logged."""

import signal
import subprocess
import sys
import time
import warnings
from pathlib import Path

import pytest
from drives import Simulated, write
from live.loopback import LONG_S
from rerun.chunk import RrdReader


@pytest.fixture(scope="module")
def whole(minute: Simulated, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write(tmp_path_factory.mktemp("whole") / "recording.mcap", minute.arrivals, flush_every=100)


def logged_poses(rrd: Path) -> int:
    """How many moments there are in the log of the robot's place."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "RRD file has no footer")
        chunks = RrdReader(rrd).stream().filter(content="/map/robot").to_chunks()
        return sum(chunk.num_rows for chunk in chunks if not chunk.is_static)


FAILING = """
import sys
from wayfi.service.cli import app as cli
from wayfi.frontends.pipeline import Pipeline
whole, count = Pipeline.process, 0
def process(self, measurement, published):
    global count
    count += 1
    if count == 900:
        raise RuntimeError("out of luck")
    return whole(self, measurement, published)
Pipeline.process = process
sys.argv = ["wayfi", "replay", *sys.argv[1:]]
cli.main()
"""


def test_an_exception_leaves_what_was_logged(whole: Path, tmp_path: Path) -> None:
    command = [sys.executable, "-c", FAILING, str(whole), "--out", str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=LONG_S, check=False)
    assert done.returncode == 1
    assert "out of luck" in done.stderr
    assert logged_poses(tmp_path / "session.rrd") > 30


def wait_until_still(path: Path) -> None:
    """Until nothing has been added to a file for two seconds."""
    size = -1
    while path.stat().st_size != size:
        size = path.stat().st_size
        time.sleep(2.0)


@pytest.mark.parametrize(("sent", "code"), [(signal.SIGKILL, -signal.SIGKILL), (signal.SIGINT, 130)])
def test_a_killed_replay_leaves_what_was_logged(whole: Path, tmp_path: Path, sent: signal.Signals, code: int) -> None:
    rrd = tmp_path / "session.rrd"
    command = [sys.executable, "-m", "wayfi.service.cli", "replay", str(whole), "--out", str(tmp_path), "--rate", "10"]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as process:
        while process.poll() is None and not (rrd.exists() and rrd.stat().st_size > 300_000):
            time.sleep(0.02)
        process.send_signal(sent)
        _, error = process.communicate(timeout=LONG_S)
    assert (process.returncode, "Traceback" in error) == (code, False), error
    wait_until_still(rrd)  # the process that logs ends the file after the one that was killed
    assert logged_poses(rrd) > 5


def test_of_two_replays_at_once_the_second_is_refused_until_the_first_has_died(whole: Path, tmp_path: Path) -> None:
    command = [sys.executable, "-m", "wayfi.service.cli", "replay", str(whole), "--out", str(tmp_path)]
    with subprocess.Popen([*command, "--rate", "1"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as first:
        while not (tmp_path / "partial").exists():
            assert first.poll() is None
            time.sleep(0.02)
        second = subprocess.run([*command, "--quiet"], capture_output=True, text=True, timeout=LONG_S, check=False)
        first.kill()
    told = f"wayfi: {tmp_path}: another run is writing its results there; wait for its end, or name another folder\n"
    assert (second.returncode, second.stderr) == (1, told)
    third = subprocess.run(
        [*command, "--no-rrd", "--quiet"], capture_output=True, text=True, timeout=LONG_S, check=False
    )
    assert (third.returncode, (tmp_path / "report.json").exists()) == (0, True), third.stderr
