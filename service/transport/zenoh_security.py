"""Passwords, certificates and access control, as Zenoh's settings.

Secrets are in files of their own: the configuration, which each run saves, only holds their paths.
"""

import json
import stat
from pathlib import Path
from typing import Any

import zenoh

from wayfi.backend.errors import WayfiError
from wayfi.service.config import SecurityConfig

SECTION = "zenoh.security"
SECRET = {"password_file", "users_file", "key"}


class SecurityError(WayfiError):
    """A file of zenoh.security that is missing, wrong or readable by everyone, or a key that lacks its companion."""


def security_settings(config: SecurityConfig, admits: bool) -> dict[str, Any]:
    """Zenoh's settings for `config`, by Zenoh's key.

    A session that `admits` others also checks their passwords and applies access control. Raises SecurityError.
    """
    _need(config, "user", "password_file")
    _need(config, "password_file", "user")
    _need(config, "certificate", "key")
    _need(config, "key", "certificate")
    _need(config, "certificate", "root_ca")
    settings = {"transport/auth/usrpwd": _passwords(config, admits), "transport/link/tls": _certificates(config)}
    if admits and config.access_control_file:
        settings["access_control"] = _access_control(config)
    return {key: value for key, value in settings.items() if value}


def credentials(config: SecurityConfig, endpoint: str) -> str:
    """What a session shows to the listener at `endpoint`, as text for a person; no secret is in it."""
    shown = [f"user {config.user!r} with {SECTION}.password_file" if config.user else f"no {SECTION}.user"]
    if endpoint.startswith(("tls/", "quic/")):
        shown.append(f"{SECTION}.certificate" if config.certificate else f"no {SECTION}.certificate")
        shown.append(f"and {SECTION}.root_ca must have signed theirs" if config.root_ca else f"no {SECTION}.root_ca")
    return ", ".join(shown)


def _passwords(config: SecurityConfig, admits: bool) -> dict[str, str]:
    settings: dict[str, str] = {}
    if config.user:
        password = _text(config, "password_file").strip()
        if not password:
            raise SecurityError(f"{SECTION}.password_file: {config.password_file} is empty")
        settings |= {"user": config.user, "password": password}
    if admits and config.users_file:
        _check_users(config)
        settings["dictionary_file"] = config.users_file
    return settings


def _check_users(config: SecurityConfig) -> None:
    for number, line in enumerate(_text(config, "users_file").splitlines(), 1):
        user, colon, password = line.partition(":")
        if line.strip() and not (user and colon and password):
            raise SecurityError(f"{SECTION}.users_file: {config.users_file}, line {number}: must read user:password")


def _certificates(config: SecurityConfig) -> dict[str, Any]:
    settings: dict[str, Any] = {}
    if config.root_ca:
        _text(config, "root_ca")
        settings |= {"root_ca_certificate": config.root_ca, "verify_name_on_connect": True}
    if config.certificate:
        _text(config, "certificate")
        _text(config, "key")
        for side in ("listen", "connect"):
            settings |= {f"{side}_certificate": config.certificate, f"{side}_private_key": config.key}
        settings["enable_mtls"] = True
    return settings


def _access_control(config: SecurityConfig) -> Any:  # noqa: ANN401 - as Zenoh has it
    _text(config, "access_control_file")
    try:
        section = zenoh.Config.from_file(config.access_control_file).get_json("access_control")
    except zenoh.ZError as error:
        what = " ".join(str(error).split(" at /")[0].split())
        raise SecurityError(f"{SECTION}.access_control_file: {config.access_control_file}: {what}") from None
    rules = json.loads(section)
    if not rules["enabled"]:
        raise SecurityError(f"{SECTION}.access_control_file: {config.access_control_file} enables no access_control")
    return rules


def _need(config: SecurityConfig, key: str, companion: str) -> None:
    if getattr(config, key) and not getattr(config, companion):
        raise SecurityError(f"{SECTION}.{key}: needs {SECTION}.{companion}, which is empty")


def _text(config: SecurityConfig, key: str) -> str:
    """The text of the file that `key` names. Raises SecurityError, also where a secret is readable by everyone."""
    path = Path(getattr(config, key))
    try:
        if key in SECRET and stat.S_IMODE(path.stat().st_mode) & stat.S_IRWXO:
            raise SecurityError(f"{SECTION}.{key}: {path} is open to every user: chmod o= {path}")
        return path.read_text()
    except OSError as error:
        raise SecurityError(f"{SECTION}.{key}: {path} cannot be read: {error.strerror}") from None
    except UnicodeDecodeError:
        raise SecurityError(f"{SECTION}.{key}: {path} is no text") from None
