"""`wayfi publish`."""

from pathlib import Path

import pytest
from live.daemons import odometry
from live.loopback import free_port

from wayfi.recordings.mcap.writer import McapWriter
from wayfi.recordings.ros.messages import (
    ODOMETRY,
)
from wayfi.service.config import Config, ZenohConfig
from wayfi.service.replay import publish
from wayfi.service.replay.publish import PublishError, publish_recording


def test_publishing_to_nobody_is_an_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with McapWriter(tmp_path / "in.mcap") as writer:
        writer.write("/odom", ODOMETRY, "cdr", 0, odometry(0))
    monkeypatch.setattr(publish, "WAIT_S", 0.3)
    config = Config(zenoh=ZenohConfig(listen=[f"tcp/127.0.0.1:{free_port()}"]))
    with pytest.raises(PublishError, match="nobody listens at tcp/127"):
        publish_recording(tmp_path / "in.mcap", config, None)
