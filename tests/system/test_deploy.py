"""What is in deploy/: the router keeps robots apart, the unit and the container say what the daemon needs."""

import configparser
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
import zenoh
from building_maps.rounds import round_map
from live.loopback import Authority, eventually, free_port
from places import DEPLOY
from zenoh.ext import HistoryConfig, declare_advanced_subscriber

from wayfi.recordings.files.map_folder import MANIFEST
from wayfi.recordings.map.saving import save_map
from wayfi.service.config import SecurityConfig, ZenohConfig, load_config
from wayfi.service.fleet.keys import COMMON, KEYFRAMES, everywhere
from wayfi.service.fleet.map_mirror import found
from wayfi.service.fleet.map_server import MapServer
from wayfi.service.process.log_lines import LogLines
from wayfi.service.transport.output_messages import OK, Status, status_message
from wayfi.service.transport.publishers import Publishers
from wayfi.service.transport.zenoh_session import RefusedError, key_of, open_guest_session, open_session

# The router of a fleet


class Fleet:
    """The router of deploy/router.json5 with certificates of its own, and those who connect to it."""

    def __init__(self, folder: Path) -> None:
        self.authority = Authority(folder)
        self.authority.issue("router", "127.0.0.1")
        self.endpoint = f"tls/127.0.0.1:{free_port()}"
        text = (DEPLOY / "router.json5").read_text()
        for theirs, ours in (("/etc/wayfi", str(folder)), ("tls/0.0.0.0:7447", self.endpoint)):
            assert theirs in text
            text = text.replace(theirs, ours)
        self.file = folder / "router.json5"
        self.file.write_text(text)

    def router(self) -> zenoh.Session:
        return zenoh.open(zenoh.Config.from_file(str(self.file)))

    def config(self, name: str, listen: list[str] | None = None) -> ZenohConfig:
        certificate, key = self.authority.issue(name)
        security = SecurityConfig(root_ca=str(self.authority.root), certificate=str(certificate), key=str(key))
        return ZenohConfig(prefix=name, listen=listen or [], connect=[self.endpoint], security=security)

    def guest(self, name: str) -> zenoh.Session:
        return open_guest_session(self.config(name))


@pytest.fixture
def fleet(tmp_path: Path) -> Fleet:
    return Fleet(tmp_path / "fleet")


def put(session: zenoh.Session, key: str, text: str) -> None:
    session.put(key, text, congestion_control=zenoh.CongestionControl.BLOCK)


@contextmanager
def heard(session: zenoh.Session, key: str) -> Iterator[list[str]]:
    """What a subscriber of `key` receives from others, as long as it is entered."""
    texts: list[str] = []

    def keep(sample: zenoh.Sample) -> None:
        texts.append(f"{sample.key_expr}: {sample.payload.to_string()}")

    with session.declare_subscriber(key, keep, allowed_origin=zenoh.Locality.REMOTE):
        yield texts


def test_a_robot_writes_under_its_own_prefix_alone(fleet: Fleet) -> None:
    with (
        fleet.router(),
        fleet.guest("robot-a") as a,
        fleet.guest("robot-b") as b,
        fleet.guest("robot-b") as sensor,
        fleet.guest("station") as station,
        heard(b, "robot-b/odom") as by_b,
        heard(station, "*/odom") as by_station,
    ):
        eventually(lambda: put(a, "robot-a/odom", "a's") or by_station)
        eventually(lambda: put(sensor, "robot-b/odom", "b's") or by_b)
        for key in ("robot-b/odom", "*/odom", "**"):
            put(a, key, "forged")
            a.delete(key)
        put(station, "robot-b/odom", "forged")
        time.sleep(0.5)
    assert set(by_b) == {"robot-b/odom: b's"}
    assert set(by_station) == {"robot-a/odom: a's", "robot-b/odom: b's"}


def test_a_robot_does_not_hear_another_and_the_station_commands_each(fleet: Fleet) -> None:
    def answer(query: zenoh.Query) -> None:
        with query:
            query.reply(query.key_expr, "done")

    def answers(session: zenoh.Session) -> list[str]:
        replies = session.get("robot-b/wayfi/command/save", timeout=2.0)
        return [reply.ok.payload.to_string() for reply in replies if reply.ok]

    with (
        fleet.router(),
        fleet.guest("robot-a") as a,
        fleet.guest("robot-b") as b,
        fleet.guest("station") as station,
        heard(a, "robot-b/odom") as by_a,
        heard(station, "robot-b/odom") as by_station,
        b.declare_queryable("robot-b/wayfi/command/save", answer),
    ):
        eventually(lambda: put(b, "robot-b/odom", "b's") or by_station)
        eventually(lambda: answers(station) == ["done"])
        assert answers(a) == []
        assert by_a == []


def test_the_station_fetches_every_robots_map_and_a_robot_only_the_common_one(fleet: Fleet, tmp_path: Path) -> None:
    def maps(session: zenoh.Session, pattern: str) -> list[str]:
        return [key for key, _ in found(session, pattern)]

    for name in ("a", "b", "common"):
        save_map(tmp_path / name, round_map())
    everyones = everywhere(KEYFRAMES, MANIFEST)
    with (
        fleet.router(),
        fleet.guest("robot-a") as a,
        fleet.guest("robot-b") as b,
        fleet.guest("station") as station,
        MapServer(a, "robot-a/wayfi/keyframes", lambda: {"run": tmp_path / "a"}, LogLines()),
        MapServer(b, "robot-b/wayfi/keyframes", lambda: {"run": tmp_path / "b"}, LogLines()),
        MapServer(b, "robot-b/wayfi/common", lambda: {"map": tmp_path / "b"}, LogLines()),  # which it may not serve
        MapServer(station, "station/wayfi/common", lambda: {"map": tmp_path / "common"}, LogLines()),
    ):
        theirs = {f"robot-{name}/wayfi/keyframes/run/{MANIFEST}" for name in "ab"}
        eventually(lambda: set(maps(station, everyones)) == theirs)
        eventually(lambda: maps(a, everywhere(COMMON, MANIFEST)) == [f"station/wayfi/common/map/{MANIFEST}"])
        assert maps(a, f"robot-b/wayfi/keyframes/run/{MANIFEST}") == []


def test_the_station_sees_a_daemon_come_alive_and_the_status_that_it_kept(fleet: Fleet) -> None:
    robot = fleet.config("robot-a", [f"tcp/127.0.0.1:{free_port()}"])
    seen: list[bytes] = []
    status = Status(OK, "TRACKING", {})
    history = HistoryConfig(max_samples=1, detect_late_publishers=True)
    with (
        fleet.router(),
        open_session(robot) as session,
        Publishers(session, robot) as publishers,
        publishers.announce(),
        fleet.guest("station") as station,
    ):
        publishers.publish_status(0, status)
        eventually(lambda: alive(station, robot))
        key = key_of(robot, "wayfi/status")
        with declare_advanced_subscriber(station, key, lambda s: seen.append(s.payload.to_bytes()), history=history):
            eventually(lambda: seen)
    assert seen == [status_message(0, status)]


def alive(session: zenoh.Session, config: ZenohConfig) -> bool:
    return any(reply.ok for reply in session.liveliness().get(key_of(config, "wayfi/alive"), timeout=1.0))


def test_a_certificate_that_nobody_listed_may_do_nothing_and_a_strangers_does_not_get_in(
    fleet: Fleet, tmp_path: Path
) -> None:
    with fleet.router(), fleet.guest("robot-c") as c, fleet.guest("station") as station:
        with heard(station, "**") as by_station:
            put(c, "robot-c/odom", "c's")
            put(c, "robot-a/odom", "c's")
            time.sleep(0.5)
        assert by_station == []
        fleet.authority = Authority(tmp_path / "strangers")
        with pytest.raises(RefusedError):
            fleet.guest("robot-a")


# The unit and the container


def unit() -> configparser.RawConfigParser:
    parser = configparser.RawConfigParser(strict=False, comment_prefixes=("#",))
    parser.optionxform = str  # type: ignore[assignment,method-assign]  # keys as they are written
    parser.read(DEPLOY / "wayfi.service")
    return parser


def test_the_unit_gives_the_daemon_the_folder_of_its_configuration() -> None:
    service = unit()["Service"]
    assert f"/var/lib/{service['StateDirectory']}" == load_config([DEPLOY / "robot.toml"]).recording.directory
    assert service["ExecStart"].split()[1:] == ["run", "--config", "/etc/wayfi/robot.toml"]
    assert (service["Type"], service["User"], service["Restart"]) == ("notify", "wayfi", "always")


@pytest.mark.skipif(not shutil.which("systemd-analyze"), reason="systemd-analyze is not installed")
def test_systemd_takes_the_unit(tmp_path: Path) -> None:
    text = (DEPLOY / "wayfi.service").read_text().replace("/opt/wayfi/bin/wayfi", sys.executable)
    (tmp_path / "wayfi.service").write_text(text)
    done = subprocess.run(
        ["systemd-analyze", "verify", "--man=no", str(tmp_path / "wayfi.service")], capture_output=True, text=True
    )
    assert (done.returncode, done.stderr) == (0, "")


def test_the_container_is_made_of_files_that_are_there() -> None:
    words = [line.split() for line in (DEPLOY / "Containerfile").read_text().splitlines()]
    copied = [name for line in words if line[:1] == ["COPY"] and "--from=build" not in line for name in line[1:-1]]
    assert copied
    assert [name for name in copied if not (DEPLOY.parent / name).exists()] == []


def health(config: Path) -> "subprocess.CompletedProcess[str]":
    command = [sys.executable, str(DEPLOY / "healthcheck.py"), str(config)]
    return subprocess.run(command, capture_output=True, text=True, timeout=30)


def test_the_healthcheck_tells_a_daemon_that_is_ready_from_one_that_is_not(tmp_path: Path) -> None:
    config = ZenohConfig(listen=[f"tcp/127.0.0.1:{free_port()}"], prefix="robot-a")
    file = tmp_path / "robot.toml"
    file.write_text(f'[zenoh]\nlisten = ["{config.listen[0]}"]\nconnect = ["tcp/127.0.0.1:1"]\nprefix = "robot-a"\n')
    away = health(file)
    with open_session(config) as session, Publishers(session, config) as publishers:
        starting = health(file)
        with publishers.announce():
            ready = health(file)
    assert [away.returncode, starting.returncode, ready.returncode] == [1, 1, 0]
    assert [len(done.stderr.splitlines()) for done in (away, starting, ready)] == [1, 1, 0]
