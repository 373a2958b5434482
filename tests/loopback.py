"""What tests over real sessions and processes share: free ports, waiting, and certificates."""

import socket
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import trustme

CLI = [sys.executable, "-m", "wayfi.service.cli"]


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def eventually(condition: Callable[[], Any], seconds: float = 30.0) -> None:
    """Wait until `condition` holds; fail where it does not for so long."""
    deadline_s = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline_s, "it never came to be"
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
