"""Access control between real sessions."""

import time
from dataclasses import replace
from pathlib import Path

import zenoh
from live.loopback import ACCESS_RULES, as_user, endpoint, eventually

from wayfi.service.config import SecurityConfig, ZenohConfig
from wayfi.service.transport.zenoh_session import (
    open_guest_session,
    open_session,
)


def test_access_control_lets_one_user_put_and_not_another(users: Path, tmp_path: Path) -> None:
    (tmp_path / "rules.json5").write_text(ACCESS_RULES)
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
