"""What `wayfi run` says, in one line, where it cannot start."""

import socket
import subprocess
from pathlib import Path

import pytest
from live.loopback import CLI, LONG_S, free_port


def test_a_port_in_use_is_one_line(tmp_path: Path) -> None:
    with socket.socket() as holder:
        holder.bind(("127.0.0.1", 0))
        holder.listen()
        port = holder.getsockname()[1]
        words = ["--set", f"zenoh.listen=['tcp/127.0.0.1:{port}']", "--set", f"recording.directory={tmp_path}/runs"]
        done = subprocess.run([*CLI, "run", *words], capture_output=True, text=True, timeout=LONG_S)
    assert done.returncode == 1
    (line,) = done.stderr.splitlines()
    assert str(port) in line
    assert "in use" in line
    assert not (tmp_path / "runs").exists()


def test_a_directory_that_cannot_be_written_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    words = [
        *("--set", f"zenoh.listen=['tcp/127.0.0.1:{free_port()}']", "--set", f"rerun.port={free_port()}"),
        *("--set", f"recording.directory={tmp_path / 'file' / 'runs'}"),
    ]
    done = subprocess.run([*CLI, "run", *words], capture_output=True, text=True, timeout=LONG_S)
    assert done.returncode == 1
    (line,) = done.stderr.splitlines()
    assert line.startswith(f"wayfi: {tmp_path}/file/runs")
    assert "cannot be written" in line


@pytest.mark.parametrize("setting", ["zenoh.no_key=1", "zenoh.security.password=secret", "zenoh.odom_queue=0"])
def test_an_unknown_or_wrong_setting_is_one_line(setting: str) -> None:
    done = subprocess.run([*CLI, "run", "--set", setting], capture_output=True, text=True, timeout=LONG_S)
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert line.startswith(f"wayfi: {setting.partition('=')[0]}: ")
