"""Commands to a running daemon, and what they leave."""

import json
from functools import partial
from pathlib import Path
from typing import Any

import zenoh
from live.daemons import Running, odometry, running
from live.loopback import LONG_S, eventually

from wayfi.recordings.files.tum import read_tum
from wayfi.recordings.mcap.recording import open_recording
from wayfi.recordings.ros.topics import CONTROL_TOPIC
from wayfi.service.drive.control_records import ControlKind, ControlRecord, parse_control_record


def asked(daemon: Running, name: str, parameters: str = "", payload: str | None = None) -> dict[str, Any]:
    key = daemon.key(f"wayfi/command/{name}") + (f"?{parameters}" if parameters else "")
    (reply,) = daemon.session.get(key, payload=payload, timeout=LONG_S)
    assert reply.ok is not None
    answer = json.loads(reply.ok.payload.to_bytes())
    assert set(answer) == {"ok", "message"}
    return dict(answer)


def drive(daemon: Running, numbers: range) -> None:
    put = partial(daemon.session.put, congestion_control=zenoh.CongestionControl.BLOCK)
    for number in numbers:
        put(daemon.key("odom"), odometry(number))


def control_records(folder: Path) -> list[ControlRecord]:
    return [parse_control_record(r.data) for r in open_recording(folder) if r.topic == CONTROL_TOPIC]


def test_a_pause_drops_what_comes_until_it_is_over(tmp_path: Path) -> None:
    with running(tmp_path / "runs") as daemon:
        daemon.collect("wayfi/pose")
        drive(daemon, range(10))
        eventually(lambda: len(daemon.samples["wayfi/pose"]) == 10)
        assert asked(daemon, "pause")["ok"]
        drive(daemon, range(10, 20))
        eventually(lambda: daemon.status().get("dropped./odom.paused") == "10")
        assert daemon.status()["paused"] == "true"
        assert asked(daemon, "resume")["ok"]
        drive(daemon, range(20, 30))
        eventually(lambda: len(daemon.samples["wayfi/pose"]) == 20)
        assert daemon.stop() == 0
        commands = [r.text for r in control_records(daemon.folder) if r.kind is ControlKind.COMMAND]
        assert commands == ["pause", "resume"]
        trajectory = read_tum(daemon.folder / "trajectory.tum")
        assert len(trajectory.stamps_ns) == 20


def test_a_save_writes_the_files_and_the_drive_goes_on(tmp_path: Path) -> None:
    with running(tmp_path / "runs") as daemon:
        daemon.collect("wayfi/pose")
        drive(daemon, range(10))
        eventually(lambda: len(daemon.samples["wayfi/pose"]) == 10)
        assert str(daemon.folder) in asked(daemon, "save")["message"]
        saved = (daemon.folder / "trajectory.tum").read_text()
        drive(daemon, range(10, 20))
        eventually(lambda: len(daemon.samples["wayfi/pose"]) == 20)
        assert daemon.stop() == 0
        assert len(saved.splitlines()) == 10
        assert len((daemon.folder / "trajectory.tum").read_text().splitlines()) == 20


def test_a_reset_begins_a_run_of_its_own(tmp_path: Path) -> None:
    with running(tmp_path / "runs") as daemon:
        daemon.collect("wayfi/pose")
        drive(daemon, range(10))
        eventually(lambda: len(daemon.samples["wayfi/pose"]) == 10)
        first = daemon.folder
        assert asked(daemon, "reset")["ok"]
        eventually(lambda: len(list(daemon.directory.iterdir())) == 2)
        eventually(lambda: (first / "report.json").exists())
        eventually(lambda: asked_or_none(daemon, "resume"))
        drive(daemon, range(10, 20))
        eventually(lambda: len(daemon.samples["wayfi/pose"]) == 20)
        assert daemon.stop() == 0
        (second,) = set(daemon.directory.iterdir()) - {first}
        lengths = [len(read_tum(folder / "trajectory.tum").stamps_ns) for folder in (first, second)]
        assert lengths == [10, 10]
        assert abs(read_tum(second / "trajectory.tum").poses[0, :2]).max() == 0.0


def asked_or_none(daemon: Running, name: str) -> bool:
    return any(reply.ok for reply in daemon.session.get(daemon.key(f"wayfi/command/{name}"), timeout=1.0))


def test_modes(tmp_path: Path) -> None:
    with running(tmp_path / "runs") as daemon:
        assert asked(daemon, "mode", "mapping")["ok"]
        assert asked(daemon, "mode", "mode=mapping")["ok"]
        assert asked(daemon, "mode", payload='"mapping"')["ok"]
        refused = asked(daemon, "mode", payload="localization")
        assert not refused["ok"]
        assert "localization" in refused["message"]
        assert not asked(daemon, "mode", payload="\x00garbage")["ok"]
