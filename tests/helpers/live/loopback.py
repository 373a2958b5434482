"""What tests over real sessions and processes share: free endpoints, waiting, a daemon's process, and credentials."""

import json
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import trustme

from wayfi.service.config import SecurityConfig, ZenohConfig

ACCESS_RULES = """{
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
CLI = [sys.executable, "-m", "wayfi.service.cli"]
LONG_S = 120.0  # for what takes a second or two where nothing else runs


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def endpoint(protocol: str = "tcp") -> str:
    """A free endpoint on loopback."""
    return f"{protocol}/127.0.0.1:{free_port()}"


def eventually(condition: Callable[[], Any], seconds: float = LONG_S) -> None:
    """Wait until `condition` holds; fail where it does not for so long."""
    deadline_s = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline_s, "the condition never held"
        time.sleep(0.02)


def secret(path: Path, text: str) -> Path:
    """A file that nobody else may read."""
    path.write_text(text)
    path.chmod(0o600)
    return path


class Authority:
    """A certificate authority in a folder: `ca.pem`, and `NAME.pem` and `NAME.key` of all that it issued."""

    def __init__(self, folder: Path) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self._folder = folder
        self._ca = trustme.CA()
        self.root = folder / "ca.pem"
        self._ca.cert_pem.write_to_path(str(self.root))

    def issue(self, name: str, *hosts: str) -> tuple[Path, Path]:
        """Certificate and key with this common name, for these hosts (one of that name where there is none)."""
        issued = self._ca.issue_cert(*(hosts or (name,)), common_name=name)
        certificate, key = self._folder / f"{name}.pem", self._folder / f"{name}.key"
        certificate.write_text("".join(pem.bytes().decode() for pem in issued.cert_chain_pems))
        secret(key, issued.private_key_pem.bytes().decode())
        return certificate, key


def settings_words(config: ZenohConfig) -> list[str]:
    """`config` as --set on the command line, where it is not the default."""
    plain = {f"zenoh.{key}": getattr(config, key) for key in ("mode", "listen", "connect", "prefix")}
    security = {f"zenoh.security.{key}": value for key, value in vars(config.security).items() if value}
    return [word for key, value in (plain | security).items() for word in ("--set", f"{key}={json.dumps(value)}")]


@contextmanager
def daemon_process(config: ZenohConfig, folder: Path) -> Iterator[tuple["subprocess.Popen[bytes]", Path]]:
    """A daemon process, and the file of its log."""
    log = folder / "log"
    words = ["--set", f"recording.directory={folder / 'runs'}", "--set", f"rerun.port={free_port()}"]
    with log.open("wb") as stderr:
        process = subprocess.Popen([*CLI, "run", *settings_words(config), *words], stderr=stderr)
    try:
        yield process, log
    finally:
        process.kill()
        process.wait()


def logged(log: Path, event: str) -> list[dict[str, Any]]:
    """The complete lines of a log with this `event`."""
    lines = [json.loads(line) for line in log.read_text().splitlines(keepends=True) if line.endswith("\n")]
    return [line for line in lines if line["event"] == event]


def as_user(folder: Path, user: str, password: str) -> SecurityConfig:
    """A user whose password is in a file in `folder`."""
    return SecurityConfig(user=user, password_file=str(secret(folder / f"{user}.password", password + "\n")))


def with_certificate(authority: Authority, name: str, *hosts: str) -> SecurityConfig:
    """A new certificate of `authority` with the name `name`."""
    certificate, key = authority.issue(name, *hosts)
    return SecurityConfig(root_ca=str(authority.root), certificate=str(certificate), key=str(key))
