"""The files of zenoh.security that are missing, open to everyone or wrong."""

from dataclasses import replace
from pathlib import Path

import pytest
from live.loopback import ACCESS_RULES, LONG_S, Authority, daemon_process, endpoint, secret, with_certificate

from wayfi.service.config import SecurityConfig, ZenohConfig
from wayfi.service.transport.zenoh_security import SecurityError
from wayfi.service.transport.zenoh_session import (
    open_session,
)

FILE_KEYS = ["password_file", "users_file", "root_ca", "certificate", "key", "access_control_file"]


def complete(authority: Authority, users: Path, folder: Path) -> SecurityConfig:
    (folder / "rules.json5").write_text(ACCESS_RULES)
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
def test_a_file_with_wrong_contents_is_refused(key: str, text: str, why: str, tmp_path: Path) -> None:
    path = secret(tmp_path / "file.json5", text)
    values = {key: str(path)} | ({"user": "alice"} if key == "password_file" else {})
    line = refused(SecurityConfig(**values))
    assert line.startswith(f"zenoh.security.{key}: {path}")
    assert why in line


def test_a_missing_file_ends_the_daemon_with_one_line(tmp_path: Path) -> None:
    security = SecurityConfig(users_file=str(tmp_path / "none"))
    with daemon_process(ZenohConfig(listen=[endpoint()], security=security), tmp_path) as (process, log):
        assert process.wait(timeout=LONG_S) == 1
    (line,) = log.read_text().splitlines()
    assert line.startswith("wayfi: zenoh.security.users_file")
