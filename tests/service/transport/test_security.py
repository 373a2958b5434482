"""Who may connect and what they may do, with real sessions: passwords, certificates, access control."""

import json
import signal
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import psutil
import pytest
import zenoh
from loopback import CLI, Authority, eventually, free_port, secret

from wayfi.recordings.mcap.writer import McapWriter
from wayfi.recordings.ros.messages import ODOMETRY
from wayfi.service.config import SecurityConfig, ZenohConfig, config_toml, load_config
from wayfi.service.transport.zenoh_security import SecurityError
from wayfi.service.transport.zenoh_session import (
    MAX_MESSAGE_BYTES,
    RefusedError,
    UnreachableError,
    open_guest_session,
    open_session,
)


def endpoint(protocol: str = "tcp") -> str:
    return f"{protocol}/127.0.0.1:{free_port()}"


def settings(config: ZenohConfig) -> list[str]:
    """`config` as --set on the command line, where it is not the default."""
    plain = {f"zenoh.{key}": getattr(config, key) for key in ("mode", "listen", "connect", "prefix")}
    security = {f"zenoh.security.{key}": value for key, value in vars(config.security).items() if value}
    return [word for key, value in (plain | security).items() for word in ("--set", f"{key}={json.dumps(value)}")]


@contextmanager
def running(config: ZenohConfig, folder: Path) -> Iterator[tuple["subprocess.Popen[bytes]", Path]]:
    """A daemon process, and the file of its log."""
    log = folder / "log"
    words = ["--set", f"recording.directory={folder / 'runs'}", "--set", f"rerun.port={free_port()}"]
    with log.open("wb") as stderr:
        process = subprocess.Popen([*CLI, "run", *settings(config), *words], stderr=stderr)
    try:
        yield process, log
    finally:
        process.kill()
        process.wait()


def said(log: Path, event: str) -> list[dict[str, Any]]:
    """The complete lines of a log that tell `event`."""
    lines = [json.loads(line) for line in log.read_text().splitlines(keepends=True) if line.endswith("\n")]
    return [line for line in lines if line["event"] == event]


# Passwords


@pytest.fixture
def users(tmp_path: Path) -> Path:
    return secret(tmp_path / "users", "alice:open sesame\nbob:b\n")


def as_user(folder: Path, user: str, password: str) -> SecurityConfig:
    return SecurityConfig(user=user, password_file=str(secret(folder / f"{user}.password", password + "\n")))


def admitting(users: Path) -> ZenohConfig:
    return ZenohConfig(listen=[endpoint()], security=SecurityConfig(users_file=str(users)))


def test_the_right_password_is_let_in(users: Path, tmp_path: Path) -> None:
    daemon = admitting(users)
    guest = replace(daemon, security=as_user(tmp_path, "alice", "open sesame"))
    with open_session(daemon) as session, open_guest_session(guest) as inside:
        assert list(inside.info.peers_zid()) == [session.info.zid()]


@pytest.mark.parametrize("user", ["alice", "eve", ""])
def test_a_wrong_password_or_user_or_none_is_refused_in_one_line(user: str, users: Path, tmp_path: Path) -> None:
    daemon = admitting(users)
    security = as_user(tmp_path, user, "guessed") if user else SecurityConfig()
    with open_session(daemon), pytest.raises(RefusedError) as refused:
        open_guest_session(replace(daemon, security=security))
    assert f"{daemon.listen[0]} answers and refuses us" in str(refused.value)
    assert f"user {user!r}" in str(refused.value) or "no zenoh.security.user" in str(refused.value)
    assert "\n" not in str(refused.value)
    assert "guessed" not in str(refused.value)


def test_nobody_there_is_no_refusal() -> None:
    with pytest.raises(UnreachableError) as nobody:
        open_guest_session(ZenohConfig(connect=[endpoint()]))
    assert not isinstance(nobody.value, RefusedError)


def test_a_wrong_password_ends_publish_and_record_with_one_line(users: Path, tmp_path: Path) -> None:
    recording = tmp_path / "in.mcap"
    with McapWriter(recording) as writer:
        writer.write("/odom", ODOMETRY, "cdr", 0, b"")
    daemon = admitting(users)
    words = settings(replace(daemon, security=as_user(tmp_path, "alice", "guessed")))
    with open_session(daemon):
        for command in (["publish", str(recording)], ["record", "--out", str(tmp_path / "out.mcap")]):
            done = subprocess.run([*CLI, *command, *words], capture_output=True, text=True, timeout=60)
            assert done.returncode == 1
            (line,) = done.stderr.splitlines()
            assert "refuses us: we show user 'alice'" in line
    assert not (tmp_path / "out.mcap").exists()


def test_no_password_is_saved_with_the_configuration(users: Path, tmp_path: Path) -> None:
    security = replace(as_user(tmp_path, "alice", "open sesame"), users_file=str(users))
    config = load_config(settings=settings(ZenohConfig(security=security))[1::2])
    assert config.zenoh.security == security
    assert "sesame" not in config_toml(config)


@pytest.mark.parametrize("mode", ["peer", "client"])
def test_a_refused_daemon_says_so_once_and_gets_in_when_it_may(mode: str, users: Path, tmp_path: Path) -> None:
    router = admitting(users)
    security = as_user(tmp_path, "carol", "later")
    config = ZenohConfig(mode=mode, listen=[], connect=router.listen, security=security)
    with running(config, tmp_path) as (process, log):
        with open_session(router):
            eventually(lambda: any("refuses us" in line["text"] for line in said(log, "waiting")))
            time.sleep(3.0)  # more than one look, of more than one try
        secret(users, "carol:later\n")
        with open_session(router):
            eventually(lambda: said(log, "connected"))
            process.send_signal(signal.SIGTERM)
            assert process.wait(timeout=30) == 0
    (refused,) = [line["text"] for line in said(log, "waiting") if "refuses us" in line["text"]]
    assert "user 'carol'" in refused


def test_a_peer_that_starts_before_its_router_finds_it() -> None:
    router = ZenohConfig(mode="router", listen=[endpoint()])
    with open_session(ZenohConfig(listen=[], connect=router.listen)) as peer, open_session(router) as session:
        eventually(lambda: list(peer.info.routers_zid()))
        assert list(peer.info.routers_zid()) == [session.info.zid()]


# Certificates


@pytest.fixture
def authority(tmp_path: Path) -> Authority:
    return Authority(tmp_path / "authority")


def with_certificate(authority: Authority, name: str, *hosts: str) -> SecurityConfig:
    certificate, key = authority.issue(name, *hosts)
    return SecurityConfig(root_ca=str(authority.root), certificate=str(certificate), key=str(key))


def test_mutual_tls_lets_in_whom_the_authority_signed(authority: Authority) -> None:
    daemon = ZenohConfig(listen=[endpoint("tls")], security=with_certificate(authority, "daemon", "127.0.0.1"))
    guest = replace(daemon, security=with_certificate(authority, "guest"))
    with open_session(daemon) as session, open_guest_session(guest) as inside:
        assert list(inside.info.peers_zid()) == [session.info.zid()]


def test_mutual_tls_refuses_a_strangers_certificate_and_none(authority: Authority, tmp_path: Path) -> None:
    daemon = ZenohConfig(listen=[endpoint("tls")], security=with_certificate(authority, "daemon", "127.0.0.1"))
    stranger = with_certificate(Authority(tmp_path / "strangers"), "guest")
    forged = replace(stranger, root_ca=str(authority.root))
    nothing = SecurityConfig(root_ca=str(authority.root))
    with open_session(daemon):
        for security in (forged, nothing):
            with pytest.raises(RefusedError, match=r"zenoh\.security\.certificate") as refused:
                open_guest_session(replace(daemon, security=security))
            assert "\n" not in str(refused.value)


@pytest.mark.parametrize("host", ["elsewhere.example", "127.0.0.2"])
def test_who_listens_under_another_name_is_not_trusted(host: str, authority: Authority) -> None:
    daemon = ZenohConfig(listen=[endpoint("tls")], security=with_certificate(authority, "daemon", host))
    guest = replace(daemon, security=with_certificate(authority, "guest"))
    with open_session(daemon), pytest.raises(RefusedError):
        open_guest_session(guest)


def test_plain_tcp_does_not_get_past_tls(authority: Authority) -> None:
    daemon = ZenohConfig(listen=[endpoint("tls")], security=with_certificate(authority, "daemon", "127.0.0.1"))
    with open_session(daemon), pytest.raises(RefusedError):
        open_guest_session(ZenohConfig(connect=[daemon.listen[0].replace("tls", "tcp")]))


# Access control


RULES = """{
  access_control: {
    enabled: true,
    default_permission: "deny",
    rules: [{
      id: "sensors",
      permission: "allow",
      flows: ["ingress", "egress"],
      messages: ["put", "declare_subscriber"],
      key_exprs: ["odom", "wayfi/pose"],
    }],
    subjects: [{ id: "sensors", usernames: ["alice"] }],
    policies: [{ rules: ["sensors"], subjects: ["sensors"] }],
  },
}"""


def test_access_control_lets_one_user_put_and_not_another(users: Path, tmp_path: Path) -> None:
    (tmp_path / "rules.json5").write_text(RULES)
    security = SecurityConfig(users_file=str(users), access_control_file=str(tmp_path / "rules.json5"))
    daemon = ZenohConfig(listen=[endpoint()], security=security)
    received: list[str] = []
    poses: list[str] = []
    with (
        open_session(daemon) as session,
        session.declare_subscriber("odom", lambda sample: received.append(sample.payload.to_string())),
        open_guest_session(replace(daemon, security=as_user(tmp_path, "alice", "open sesame"))) as alice,
        open_guest_session(replace(daemon, security=as_user(tmp_path, "bob", "b"))) as bob,
        alice.declare_subscriber("wayfi/pose", lambda sample: poses.append(sample.payload.to_string())),
        session.declare_publisher("wayfi/pose") as publisher,
    ):
        for _ in range(3):
            bob.put("odom", "bob's", congestion_control=zenoh.CongestionControl.BLOCK)
        bob.put("wayfi/pose", "bob's", congestion_control=zenoh.CongestionControl.BLOCK)
        time.sleep(0.5)
        alice.put("odom", "alice's", congestion_control=zenoh.CongestionControl.BLOCK)
        eventually(lambda: received)
        eventually(lambda: publisher.put("the daemon's") or poses)
    assert received == ["alice's"]
    assert set(poses) == {"the daemon's"}


# Files that will not do


FILE_KEYS = ["password_file", "users_file", "root_ca", "certificate", "key", "access_control_file"]


def complete(authority: Authority, users: Path, folder: Path) -> SecurityConfig:
    (folder / "rules.json5").write_text(RULES)
    return replace(
        with_certificate(authority, "daemon", "127.0.0.1"),
        user="alice",
        password_file=str(secret(folder / "password", "open sesame")),
        users_file=str(users),
        access_control_file=str(folder / "rules.json5"),
    )


def refused(security: SecurityConfig) -> str:
    with pytest.raises(SecurityError) as caught:
        open_session(ZenohConfig(listen=[], security=security))
    assert "\n" not in str(caught.value)
    assert ".rs:" not in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize("key", FILE_KEYS)
def test_a_file_that_is_missing_is_one_line_with_its_key(
    key: str, authority: Authority, users: Path, tmp_path: Path
) -> None:
    security = complete(authority, users, tmp_path)
    open_session(ZenohConfig(listen=[], security=security)).close()
    for path, why in ((tmp_path / "none", "No such file"), (tmp_path, "Is a directory")):
        tmp_path.chmod(0o700)
        line = refused(replace(security, **{key: str(path)}))
        assert line.startswith(f"zenoh.security.{key}: {path} cannot be read")
        assert why in line


@pytest.mark.parametrize("key", ["password_file", "users_file", "key"])
def test_a_secret_that_everyone_may_read_is_refused(
    key: str, authority: Authority, users: Path, tmp_path: Path
) -> None:
    security = complete(authority, users, tmp_path)
    Path(getattr(security, key)).chmod(0o644)
    assert refused(security).startswith(f"zenoh.security.{key}: {getattr(security, key)} is open to every user")


@pytest.mark.parametrize(
    ("key", "companion"), [("user", "password_file"), ("password_file", "user"), ("certificate", "key")]
)
def test_a_key_without_its_companion_is_refused(
    key: str, companion: str, authority: Authority, users: Path, tmp_path: Path
) -> None:
    security = complete(authority, users, tmp_path)
    assert refused(replace(security, **{companion: ""})).startswith(f"zenoh.security.{key}: needs")


@pytest.mark.parametrize(
    ("key", "text", "why"),
    [
        ("password_file", "\n", "is empty"),
        ("users_file", "alice:a\nbob\n", "line 2: must read user:password"),
        ("access_control_file", "{access_control: {enabled: true, rules: [{permit: 1}]}}", "unknown field"),
        ("access_control_file", "{}", "enables no access_control"),
    ],
)
def test_a_file_that_says_nothing_of_use_is_refused(key: str, text: str, why: str, tmp_path: Path) -> None:
    path = secret(tmp_path / "file.json5", text)
    values = {key: str(path)} | ({"user": "alice"} if key == "password_file" else {})
    line = refused(SecurityConfig(**values))
    assert line.startswith(f"zenoh.security.{key}: {path}")
    assert why in line


def test_a_missing_file_ends_the_daemon_with_one_line(tmp_path: Path) -> None:
    security = SecurityConfig(users_file=str(tmp_path / "none"))
    with running(ZenohConfig(listen=[endpoint()], security=security), tmp_path) as (process, log):
        assert process.wait(timeout=60) == 1
    (line,) = log.read_text().splitlines()
    assert line.startswith("wayfi: zenoh.security.users_file")


# Nothing without bounds, and nothing beyond loopback


def test_a_message_of_any_size_is_let_go_and_the_next_one_is_received() -> None:
    config = ZenohConfig(listen=[endpoint()])
    received: list[int] = []
    with (
        open_session(config) as session,
        session.declare_subscriber("points", lambda sample: received.append(len(sample.payload))),
        open_guest_session(config) as guest,
        guest.declare_publisher("points", congestion_control=zenoh.CongestionControl.BLOCK) as publisher,
    ):
        for size in (MAX_MESSAGE_BYTES // 2, MAX_MESSAGE_BYTES + 1, 7):
            publisher.put(bytes(size))
        eventually(lambda: 7 in received)
    assert received == [MAX_MESSAGE_BYTES // 2, 7]


def test_nothing_listens_beyond_loopback_unless_told_to(tmp_path: Path) -> None:
    config = ZenohConfig(listen=[endpoint()])
    with running(config, tmp_path) as (process, log):
        eventually(lambda: said(log, "ready"), 120.0)
        whole = [psutil.Process(process.pid), *psutil.Process(process.pid).children(recursive=True)]
        found = [c for p in whole for c in p.net_connections("inet") if c.status in (psutil.CONN_LISTEN, "NONE")]
    assert {f"tcp/{c.laddr.ip}:{c.laddr.port}" for c in found} >= {config.listen[0]}
    assert {c.laddr.ip for c in found} == {"127.0.0.1"}
