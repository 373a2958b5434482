"""Users and passwords between real sessions."""

import signal
import subprocess
import time
from dataclasses import replace
from pathlib import Path

import pytest
from live.loopback import CLI, LONG_S, as_user, daemon_process, endpoint, eventually, logged, secret, settings_words

from wayfi.recordings.mcap.writer import McapWriter
from wayfi.recordings.ros.messages import ODOMETRY
from wayfi.service.config import SecurityConfig, ZenohConfig, config_toml, load_config
from wayfi.service.transport.zenoh_session import (
    RefusedError,
    open_guest_session,
    open_session,
)


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


def test_a_wrong_password_ends_publish_and_record_with_one_line(users: Path, tmp_path: Path) -> None:
    recording = tmp_path / "in.mcap"
    with McapWriter(recording) as writer:
        writer.write("/odom", ODOMETRY, "cdr", 0, b"")
    daemon = admitting(users)
    words = settings_words(replace(daemon, security=as_user(tmp_path, "alice", "guessed")))
    with open_session(daemon):
        for command in (["publish", str(recording)], ["record", "--out", str(tmp_path / "out.mcap")]):
            done = subprocess.run([*CLI, *command, *words], capture_output=True, text=True, timeout=LONG_S)
            assert done.returncode == 1
            (line,) = done.stderr.splitlines()
            assert "refuses us: we show user 'alice'" in line
    assert not (tmp_path / "out.mcap").exists()


def test_no_password_is_saved_with_the_configuration(users: Path, tmp_path: Path) -> None:
    security = replace(as_user(tmp_path, "alice", "open sesame"), users_file=str(users))
    config = load_config(settings=settings_words(ZenohConfig(security=security))[1::2])
    assert config.zenoh.security == security
    assert "sesame" not in config_toml(config)


@pytest.mark.parametrize("mode", ["peer", "client"])
def test_a_refused_daemon_logs_it_once_and_connects_when_it_may(mode: str, users: Path, tmp_path: Path) -> None:
    router = admitting(users)
    security = as_user(tmp_path, "carol", "later")
    config = ZenohConfig(mode=mode, listen=[], connect=router.listen, security=security)
    with daemon_process(config, tmp_path) as (process, log):
        with open_session(router):
            eventually(lambda: any("refuses us" in line["text"] for line in logged(log, "waiting")))
            time.sleep(3.0)  # more than one look, of more than one try
        secret(users, "carol:later\n")
        with open_session(router):
            eventually(lambda: logged(log, "connected"))
            process.send_signal(signal.SIGTERM)
            assert process.wait(timeout=LONG_S) == 0
    (refused,) = [line["text"] for line in logged(log, "waiting") if "refuses us" in line["text"]]
    assert "user 'carol'" in refused
