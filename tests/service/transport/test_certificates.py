"""Mutual TLS between real sessions."""

from dataclasses import replace
from pathlib import Path

import pytest
from live.loopback import Authority, endpoint, with_certificate

from wayfi.service.config import SecurityConfig, ZenohConfig
from wayfi.service.transport.zenoh_session import (
    RefusedError,
    open_guest_session,
    open_session,
)


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
